#include "tflite_tensors.h"

#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <opencv2/core.hpp>

namespace mpc::internal {
namespace {

// Numbers of the schema.
enum TensorType { kFloat32 = 0, kFloat16 = 1, kInt32 = 2 };
enum DimensionFormat { kDense = 0, kSparseCsr = 1 };

constexpr std::uint64_t kMaxAxes = 8;
constexpr std::int64_t kMaxTensorValues = std::int64_t{1} << 24;
// Constants together, per byte of the file: half floats that are 15/16 zeros need 16.
constexpr std::int64_t kMaxValuesPerByte = 16;

// The numbers of a constant as they are stored.
class StoredFloats {
 public:
  StoredFloats(const FlatBytes* file, const FlatTable& tensor, FlatVector data)
      : file_(file), at_(data.at()) {
    const int type = tensor.Scalar<std::int8_t>(1);
    if (type != kFloat32 && type != kFloat16) {
      throw Error(ErrorCode::kUnsupported,
                  fmt::format("{}: weights of type {}, expected floats", file->name, type));
    }
    size_ = type == kFloat32 ? 4 : 2;
    if (data.size() % size_ != 0) tensor.Fail("a part of a number at the end of the data");
    count_ = static_cast<std::int64_t>(data.size() / size_);
  }
  std::int64_t count() const { return count_; }
  float operator[](std::int64_t i) const {
    const std::uint64_t at = at_ + size_ * static_cast<std::uint64_t>(i);
    if (size_ == 4) return file_->Read<float>(at);
    return static_cast<float>(cv::float16_t::fromBits(file_->Read<std::uint16_t>(at)));
  }

 private:
  const FlatBytes* file_;
  std::uint64_t at_;
  std::uint64_t size_ = 0;
  std::int64_t count_ = 0;
};

// A table with one vector of unsigned numbers; the field before it says how wide they are.
class Indices {
 public:
  Indices(const FlatTable& dimension, int type_field)
      : width_(Width(dimension, dimension.Scalar<std::uint8_t>(type_field))),
        vector_(dimension.Table(type_field + 1).Vector(0, static_cast<std::uint64_t>(width_))) {}
  std::int64_t size() const { return static_cast<std::int64_t>(vector_.size()); }
  std::int64_t operator[](std::int64_t i) const {
    const auto index = static_cast<std::uint64_t>(i);
    if (width_ == 4) return vector_.Get<std::uint32_t>(index);
    if (width_ == 2) return vector_.Get<std::uint16_t>(index);
    return vector_.Get<std::uint8_t>(index);
  }

 private:
  static int Width(const FlatTable& dimension, int type) {
    if (type < 1 || type > 3) dimension.Fail(fmt::format("indices of type {}", type));
    return std::array{4, 2, 1}[static_cast<size_t>(type - 1)];
  }
  int width_;
  FlatVector vector_;
};

// All axes dense and in their own order, but the last one, which is compressed sparse rows.
bool IsRowSparse(const FlatTable& sparsity, size_t num_axes) {
  const FlatVector order = sparsity.Vector(0, 4);
  const FlatVector dims = sparsity.Vector(2, 4);
  if (num_axes == 0 || order.size() != num_axes || dims.size() != num_axes) return false;
  if (sparsity.Vector(1, 4).size() != 0) return false;
  for (std::uint64_t d = 0; d < num_axes; ++d) {
    const int format = dims.Table(d).Scalar<std::int8_t>(0);
    if (order.Get<std::int32_t>(d) != static_cast<std::int32_t>(d)) return false;
    if (format != (d + 1 == num_axes ? kSparseCsr : kDense)) return false;
  }
  return true;
}

}  // namespace

TfliteTensors::TfliteTensors(const FlatBytes* file, FlatVector tensors, FlatVector buffers)
    : file_(file),
      tables_(tensors),
      buffers_(buffers),
      values_left_(kMaxValuesPerByte * static_cast<std::int64_t>(file->bytes.size())) {
  // Each takes at least an offset in the file, so its size bounds their number.
  for (std::uint64_t i = 0; i < tables_.size(); ++i) {
    const FlatTable table = tables_.Table(i);
    const FlatVector shape = table.Vector(0, 4);
    if (shape.size() > kMaxAxes) table.Fail(fmt::format("a tensor of {} axes", shape.size()));
    GraphTensor& tensor = tensors_.emplace_back();
    std::int64_t count = 1;
    for (std::uint64_t d = 0; d < shape.size(); ++d) {
      const auto size = shape.Get<std::int32_t>(d);
      if (size < 1 || (count *= size) > kMaxTensorValues) {
        table.Fail(fmt::format("a tensor of size {} along axis {}", size, d));
      }
      tensor.shape.push_back(size);
    }
    states_.push_back(State::kUnknown);
    sources_.push_back(static_cast<int>(i));
  }
}

int TfliteTensors::Index(const FlatTable& place, std::int32_t index) const {
  if (index < 0 || Slot(index) >= tensors_.size()) {
    place.Fail(fmt::format("tensor {} of {}", index, tensors_.size()));
  }
  return index;
}

std::int64_t TfliteTensors::Count(int index) const {
  std::int64_t count = 1;
  for (const int size : Shape(index)) count *= size;
  return count;
}

void TfliteTensors::ExpectShape(const FlatTable& place, int index,
                                const std::vector<int>& expected) const {
  if (Shape(index) == expected) return;
  place.Fail(fmt::format("tensor {} has shape [{}], expected [{}]", index,
                         fmt::join(Shape(index), ", "), fmt::join(expected, ", ")));
}

void TfliteTensors::ExpectPicture(const FlatTable& place, int index) const {
  if (Shape(index).size() != 4 || Shape(index)[0] != 1) {
    place.Fail(fmt::format("tensor {} must be 1 x height x width x channels", index));
  }
}

void TfliteTensors::SetDecoded(const FlatTable& place, int index, int source) {
  if (IsComputed(source)) place.Fail("decodes what is no constant");
  ExpectShape(place, index, Shape(source));
  sources_[Slot(index)] = sources_[Slot(source)];
}

int TfliteTensors::Weights(const FlatTable& place, int index) {
  const int source = sources_[Slot(index)];
  if (IsComputed(source)) place.Fail(fmt::format("tensor {} must be constant", index));
  if (IsUnknown(source)) Load(source);
  return source;
}

std::vector<std::int32_t> TfliteTensors::Ints(const FlatTable& place, int index,
                                              std::int64_t count) const {
  const FlatTable tensor = tables_.Table(static_cast<std::uint64_t>(index));
  const FlatVector data = Data(tensor);
  if (tensor.Scalar<std::int8_t>(1) != kInt32 ||
      data.size() != static_cast<std::uint64_t>(4 * count)) {
    place.Fail(fmt::format("tensor {} must hold {} 32-bit integers", index, count));
  }
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < count; ++i) {
    values.push_back(file_->Read<std::int32_t>(data.at() + 4 * static_cast<std::uint64_t>(i)));
  }
  return values;
}

FlatVector TfliteTensors::Data(const FlatTable& tensor) const {
  const auto buffer = tensor.Scalar<std::uint32_t>(2);
  if (buffer >= buffers_.size()) {
    tensor.Fail(fmt::format("buffer {} of {}", buffer, buffers_.size()));
  }
  return buffers_.Table(buffer).Vector(0, 1);
}

void TfliteTensors::Load(int index) {
  const FlatTable table = tables_.Table(static_cast<std::uint64_t>(index));
  const std::int64_t count = Count(index);
  values_left_ -= count;
  if (values_left_ < 0) table.Fail("more constants than a file of this size can hold");
  std::vector<float>& values = tensors_[Slot(index)].values;
  if (table.Has(6)) {
    LoadSparse(table, Shape(index), count, &values);
  } else {
    LoadDense(table, count, &values);
  }
  for (const float value : values) {
    if (!std::isfinite(value)) table.Fail("a weight is not finite");
  }
  states_[Slot(index)] = State::kConstant;
}

void TfliteTensors::LoadDense(const FlatTable& tensor, std::int64_t count,
                              std::vector<float>* values) const {
  const StoredFloats stored(file_, tensor, Data(tensor));
  if (stored.count() != count) {
    tensor.Fail(fmt::format("{} stored numbers, expected {}", stored.count(), count));
  }
  for (std::int64_t i = 0; i < count; ++i) values->push_back(stored[i]);
}

void TfliteTensors::LoadSparse(const FlatTable& tensor, const std::vector<int>& shape,
                               std::int64_t count, std::vector<float>* values) const {
  const FlatTable sparsity = tensor.Table(6);
  if (!IsRowSparse(sparsity, shape.size())) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{}: weights that are sparse in another way than along their last axis",
                            file_->name));
  }
  const FlatVector dims = sparsity.Vector(2, 4);
  const FlatTable rows = dims.Table(dims.size() - 1);
  const StoredFloats stored(file_, tensor, Data(tensor));
  const Indices begins(rows, 2);
  const Indices columns(rows, 4);
  const int row_size = shape.back();
  const std::int64_t num_rows = count / row_size;
  if (begins.size() != num_rows + 1 || columns.size() != stored.count()) {
    tensor.Fail(fmt::format("{} row starts and {} columns for {} rows and {} numbers",
                            begins.size(), columns.size(), num_rows, stored.count()));
  }
  values->assign(static_cast<size_t>(count), 0.0f);
  std::int64_t i = 0;
  for (std::int64_t row = 0; row < num_rows; ++row) {
    if (begins[row] != i || begins[row + 1] > stored.count()) tensor.Fail("sparse rows overlap");
    for (; i < begins[row + 1]; ++i) {
      if (columns[i] >= row_size) tensor.Fail("a sparse column lies outside of its row");
      (*values)[static_cast<size_t>(row * row_size + columns[i])] = stored[i];
    }
  }
}

}  // namespace mpc::internal
