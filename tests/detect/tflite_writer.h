// Purpose: small TensorFlow Lite files for tests, written without the reader's code.
// Source: FlatBuffers' binary format; TensorFlow Lite schema, version 3.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

namespace mpc::testing {

using Bytes = std::vector<std::uint8_t>;

template <typename T>
Bytes BytesOf(const std::vector<T>& values) {
  Bytes bytes(values.size() * sizeof(T));
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

// A table of a FlatBuffer, to be filled and written.
class TableNode {
 public:
  template <typename T>
  TableNode& Scalar(int field, T value) {
    fields_[field].inline_bytes = BytesOf(std::vector<T>{value});
    return *this;
  }
  template <typename T>
  TableNode& Vector(int field, const std::vector<T>& values) {
    Field& out = fields_[field];
    out.kind = Field::kVector;
    out.count = static_cast<std::uint32_t>(values.size());
    out.inline_bytes = BytesOf(values);
    return *this;
  }
  TableNode& Table(int field, TableNode child) {
    Field& out = fields_[field];
    out.kind = Field::kTable;
    out.children.push_back(std::move(child));
    return *this;
  }
  TableNode& Tables(int field, std::vector<TableNode> children) {
    Field& out = fields_[field];
    out.kind = Field::kTables;
    out.children = std::move(children);
    return *this;
  }
  // A whole file with this table as its root.
  Bytes File(const char mark[5]) const {
    Bytes out(8);
    std::memcpy(out.data() + 4, mark, 4);
    Point(&out, 0, Write(&out));
    return out;
  }

 private:
  struct Field {
    enum Kind { kScalar, kVector, kTable, kTables } kind = kScalar;
    std::uint32_t count = 0;
    Bytes inline_bytes;
    std::vector<TableNode> children;
  };

  template <typename T>
  static void Put(Bytes* out, size_t at, T value) {
    std::memcpy(out->data() + at, &value, sizeof(T));
  }
  static void Point(Bytes* out, size_t at, size_t target) {
    Put(out, at, static_cast<std::uint32_t>(target - at));
  }
  static size_t Grow(Bytes* out, size_t size) {
    out->resize(out->size() + size);
    return out->size() - size;
  }

  // Returns where the table is.
  size_t Write(Bytes* out) const {
    const int num_fields = fields_.empty() ? 0 : fields_.rbegin()->first + 1;
    const auto list_size = static_cast<std::uint16_t>(4 + 2 * num_fields);
    const size_t list = Grow(out, list_size);
    const size_t table = Grow(out, 4);
    Put(out, table, static_cast<std::int32_t>(table - list));
    std::map<int, size_t> places;
    for (const auto& [number, field] : fields_) {
      const bool is_scalar = field.kind == Field::kScalar;
      places[number] = Grow(out, is_scalar ? field.inline_bytes.size() : 4);
      if (is_scalar) {
        std::memcpy(out->data() + places[number], field.inline_bytes.data(),
                    field.inline_bytes.size());
      }
      Put(out, list + 4 + 2 * static_cast<size_t>(number),
          static_cast<std::uint16_t>(places[number] - table));
    }
    Put(out, list, list_size);
    Put(out, list + 2, static_cast<std::uint16_t>(out->size() - table));
    for (const auto& [number, field] : fields_) {
      if (field.kind == Field::kScalar) continue;
      if (field.kind == Field::kTable) {
        const size_t child = field.children[0].Write(out);
        Point(out, places[number], child);
        continue;
      }
      const bool is_tables = field.kind == Field::kTables;
      const size_t vector =
          Grow(out, 4 + (is_tables ? 4 * field.children.size() : field.inline_bytes.size()));
      Point(out, places[number], vector);
      Put(out, vector, is_tables ? static_cast<std::uint32_t>(field.children.size()) : field.count);
      if (!is_tables && !field.inline_bytes.empty()) {
        std::memcpy(out->data() + vector + 4, field.inline_bytes.data(), field.inline_bytes.size());
      }
      for (size_t i = 0; i < field.children.size(); ++i) {
        const size_t child = field.children[i].Write(out);
        Point(out, vector + 4 + 4 * i, child);
      }
    }
    return table;
  }

  std::map<int, Field> fields_;
};

// Schema numbers of operations.
enum TfliteOp {
  kOpAdd = 0,
  kOpConcatenation = 2,
  kOpConv = 3,
  kOpDepthwiseConv = 4,
  kOpDepthToSpace = 5,
  kOpDequantize = 6,
  kOpLogistic = 14,
  kOpMaxPool = 17,
  kOpReshape = 22,
  kOpResizeBilinear = 23,
  kOpPad = 34,
  kOpDensify = 124,
};

// A network in the making. Tensor 0 is its input.
class TfliteWriter {
 public:
  using Shape = std::vector<std::int32_t>;

  explicit TfliteWriter(const Shape& input_shape) {
    buffers_.emplace_back();
    Tensor(input_shape);
  }
  int Tensor(const Shape& shape) { return Add(shape, 0, 0); }
  int Floats(const Shape& shape, const std::vector<float>& values) {
    return Add(shape, 0, Buffer(BytesOf(values)));
  }
  int Halves(const Shape& shape, const std::vector<float>& values) {
    return Add(shape, 1, Buffer(HalfBytes(values)));
  }
  int Ints(const Shape& shape, const std::vector<std::int32_t>& values) {
    return Add(shape, 2, Buffer(BytesOf(values)));
  }
  // Half floats of which only those that are not 0 are stored.
  int SparseHalves(const Shape& shape, const std::vector<float>& dense) {
    std::vector<float> stored;
    std::vector<std::uint16_t> begins = {0};
    std::vector<std::uint8_t> columns;
    const auto row_size = static_cast<size_t>(shape.back());
    for (size_t i = 0; i < dense.size(); ++i) {
      if (dense[i] != 0) {
        stored.push_back(dense[i]);
        columns.push_back(static_cast<std::uint8_t>(i % row_size));
      }
      if (i % row_size == row_size - 1) begins.push_back(static_cast<std::uint16_t>(stored.size()));
    }
    std::vector<std::int32_t> order;
    std::vector<TableNode> dims;
    for (size_t d = 0; d < shape.size(); ++d) {
      order.push_back(static_cast<std::int32_t>(d));
      dims.push_back(TableNode().Scalar<std::int32_t>(1, shape[d]));
    }
    dims.back() = TableNode()
                      .Scalar<std::int8_t>(0, 1)
                      .Scalar<std::uint8_t>(2, 2)
                      .Table(3, TableNode().Vector(0, begins))
                      .Scalar<std::uint8_t>(4, 3)
                      .Table(5, TableNode().Vector(0, columns));
    const int tensor = Add(shape, 1, Buffer(HalfBytes(stored)));
    tensors_.back().Table(6, TableNode().Vector(0, order).Tables(2, dims));
    return tensor;
  }
  int Op(TfliteOp op, const std::vector<std::int32_t>& inputs, const Shape& output_shape,
         TableNode options = {}) {
    const int output = Tensor(output_shape);
    codes_.push_back(
        TableNode().Scalar(0, static_cast<std::int8_t>(op)).Scalar<std::int32_t>(3, op));
    ops_.push_back(TableNode()
                       .Scalar(0, static_cast<std::uint32_t>(codes_.size() - 1))
                       .Vector(1, inputs)
                       .Vector<std::int32_t>(2, {output})
                       .Table(4, std::move(options)));
    return output;
  }
  Bytes File(const std::vector<std::int32_t>& outputs) const {
    const TableNode subgraph = TableNode()
                                   .Tables(0, tensors_)
                                   .Vector<std::int32_t>(1, {0})
                                   .Vector(2, outputs)
                                   .Tables(3, ops_);
    return TableNode()
        .Scalar<std::uint32_t>(0, 3)
        .Tables(1, codes_)
        .Tables(2, {subgraph})
        .Tables(4, buffers_)
        .File("TFL3");
  }

 private:
  static Bytes HalfBytes(const std::vector<float>& values) {
    cv::Mat halves;
    if (values.empty()) return {};
    cv::Mat(values, true).convertTo(halves, CV_16F);
    return {halves.data, halves.data + 2 * values.size()};
  }
  std::uint32_t Buffer(const Bytes& bytes) {
    buffers_.push_back(TableNode().Vector(0, bytes));
    return static_cast<std::uint32_t>(buffers_.size() - 1);
  }
  int Add(const Shape& shape, std::int8_t type, std::uint32_t buffer) {
    tensors_.push_back(TableNode().Vector(0, shape).Scalar(1, type).Scalar(2, buffer));
    return static_cast<int>(tensors_.size() - 1);
  }

  std::vector<TableNode> tensors_, buffers_, codes_, ops_;
};

}  // namespace mpc::testing
