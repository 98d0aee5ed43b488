#include "tflite_reader.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "flatbuffer.h"
#include "tflite_tensors.h"

namespace mpc::internal {
namespace {

// Numbers of the schema.
enum Builtin {
  kBuiltinAdd = 0,
  kBuiltinConcatenation = 2,
  kBuiltinConv2d = 3,
  kBuiltinDepthwiseConv2d = 4,
  kBuiltinDepthToSpace = 5,
  kBuiltinDequantize = 6,
  kBuiltinLogistic = 14,
  kBuiltinMaxPool2d = 17,
  kBuiltinReshape = 22,
  kBuiltinResizeBilinear = 23,
  kBuiltinPad = 34,
  kBuiltinDensify = 124,
};
enum Activation { kNone = 0, kRelu6 = 3 };
enum Padding { kSame = 0, kValid = 1 };

constexpr int kMaxWindow = 1024;  // of kernels and strides
constexpr int kMaxPad = 4096;
constexpr std::uint64_t kMaxInputs = 64;                            // of one operation
constexpr std::int64_t kMaxComputedValues = std::int64_t{1} << 27;  // all tensors together
constexpr std::int64_t kMaxProducts = std::int64_t{1} << 36;        // of all convolutions

class Reader {
 public:
  Reader(const FlatBytes* file, const FlatTable& model)
      : file_(file),
        codes_(model.Vector(1, 4)),
        subgraph_(TheSubgraph(model)),
        tensors_(file, subgraph_.Vector(0, 4), model.Vector(4, 4)) {}

  Graph Read() {
    const FlatVector inputs = subgraph_.Vector(1, 4);
    if (inputs.size() != 1) subgraph_.Fail(fmt::format("{} inputs, expected 1", inputs.size()));
    graph_.input = tensors_.Index(subgraph_, inputs.Get<std::int32_t>(0));
    tensors_.ExpectPicture(subgraph_, graph_.input);
    tensors_.SetComputed(graph_.input);
    const FlatVector ops = subgraph_.Vector(3, 4);
    for (std::uint64_t i = 0; i < ops.size(); ++i) ReadOp(ops.Table(i));
    const FlatVector outputs = subgraph_.Vector(2, 4);
    for (std::uint64_t i = 0; i < outputs.size(); ++i) {
      const int tensor = tensors_.Index(subgraph_, outputs.Get<std::int32_t>(i));
      if (!tensors_.IsComputed(tensor)) subgraph_.Fail(fmt::format("output {} is never set", i));
      graph_.outputs.push_back(tensor);
    }
    if (graph_.outputs.empty()) subgraph_.Fail("no outputs");
    graph_.tensors = tensors_.Take();
    return std::move(graph_);
  }

 private:
  using Options = std::optional<FlatTable>;

  static FlatTable TheSubgraph(const FlatTable& model) {
    const FlatVector subgraphs = model.Vector(2, 4);
    if (subgraphs.size() != 1) {
      model.Fail(fmt::format("{} subgraphs, expected 1", subgraphs.size()));
    }
    return subgraphs.Table(0);
  }

  const std::vector<int>& Shape(int index) const { return tensors_.Shape(index); }

  int Builtin(const FlatTable& op) const {
    const FlatTable code = codes_.Table(op.Scalar<std::uint32_t>(0));
    return std::max<int>(code.Scalar<std::int8_t>(0), code.Scalar<std::int32_t>(3));
  }

  template <typename T>
  static T Option(const Options& options, int field, T absent = {}) {
    return options ? options->Scalar<T>(field, absent) : absent;
  }
  static int Window(const FlatTable& op, const Options& options, int field) {
    const auto size = Option<std::int32_t>(options, field);
    if (size < 1 || size > kMaxWindow) op.Fail(fmt::format("a stride or window of {}", size));
    return size;
  }
  void ReadActivation(const Options& options, int field, GraphOp* out) const {
    const int activation = Option<std::int8_t>(options, field);
    if (activation != kNone && activation != kRelu6) {
      throw Error(ErrorCode::kUnsupported, fmt::format("{}: activation {}, expected none or RELU6",
                                                       file_->name, activation));
    }
    out->relu6 = activation == kRelu6;
  }

  void ReadOp(const FlatTable& op) {
    const int builtin = Builtin(op);
    GraphOp out;
    const FlatVector inputs = op.Vector(1, 4);
    if (inputs.size() > kMaxInputs) op.Fail(fmt::format("{} inputs", inputs.size()));
    for (std::uint64_t i = 0; i < inputs.size(); ++i) {
      out.inputs.push_back(tensors_.Index(op, inputs.Get<std::int32_t>(i)));
    }
    const FlatVector outputs = op.Vector(2, 4);
    if (out.inputs.empty() || outputs.size() != 1) {
      op.Fail(fmt::format("{} inputs and {} outputs", out.inputs.size(), outputs.size()));
    }
    out.output = tensors_.Index(op, outputs.Get<std::int32_t>(0));
    if (!tensors_.IsUnknown(out.output)) op.Fail(fmt::format("tensor {} is set twice", out.output));
    if (builtin == kBuiltinDequantize || builtin == kBuiltinDensify) {
      return tensors_.SetDecoded(op, out.output, out.inputs[0]);
    }
    if (!tensors_.IsComputed(out.inputs[0])) {
      op.Fail(fmt::format("tensor {} is used before it is computed", out.inputs[0]));
    }
    const Options options = op.Has(4) ? Options(op.Table(4)) : std::nullopt;
    ReadKind(op, builtin, options, &out);
    tensors_.SetComputed(out.output);
    computed_left_ -= tensors_.Count(out.output);
    if (computed_left_ < 0) op.Fail("the network computes more numbers than any pose network");
    graph_.ops.push_back(std::move(out));
  }

  void ReadKind(const FlatTable& op, int builtin, const Options& options, GraphOp* out) {
    switch (builtin) {
      case kBuiltinAdd:
        return ReadAdd(op, options, out);
      case kBuiltinConcatenation:
        return ReadConcat(op, options, out);
      case kBuiltinConv2d:
        return ReadConv(op, options, false, out);
      case kBuiltinDepthwiseConv2d:
        return ReadConv(op, options, true, out);
      case kBuiltinDepthToSpace:
        return ReadDepthToSpace(op, options, out);
      case kBuiltinLogistic:
        out->kind = OpKind::kLogistic;
        return tensors_.ExpectShape(op, out->output, Shape(out->inputs[0]));
      case kBuiltinMaxPool2d:
        return ReadMaxPool(op, options, out);
      case kBuiltinReshape:
        return ReadReshape(op, out);
      case kBuiltinResizeBilinear:
        return ReadResize(op, options, out);
      case kBuiltinPad:
        return ReadPad(op, out);
      default:
        throw Error(ErrorCode::kUnsupported,
                    fmt::format("{}: operation {} is none of those of MediaPipe's pose networks",
                                file_->name, builtin));
    }
  }

  void ExpectInputs(const FlatTable& op, const GraphOp& out, size_t count) const {
    if (out.inputs.size() != count) {
      op.Fail(fmt::format("{} inputs, expected {}", out.inputs.size(), count));
    }
  }

  void ReadAdd(const FlatTable& op, const Options& options, GraphOp* out) {
    out->kind = OpKind::kAdd;
    ExpectInputs(op, *out, 2);
    if (!tensors_.IsComputed(out->inputs[1])) op.Fail("adds what is not computed");
    tensors_.ExpectShape(op, out->inputs[1], Shape(out->inputs[0]));
    tensors_.ExpectShape(op, out->output, Shape(out->inputs[0]));
    ReadActivation(options, 0, out);
  }

  void ReadConcat(const FlatTable& op, const Options& options, GraphOp* out) {
    out->kind = OpKind::kConcat;
    std::vector<int> shape = Shape(out->inputs[0]);
    out->axis = Option<std::int32_t>(options, 0);
    const int rank = static_cast<int>(shape.size());
    if (out->axis < 0) out->axis += rank;
    if (out->axis < 0 || out->axis >= rank) op.Fail(fmt::format("joins along axis {}", out->axis));
    const auto axis = static_cast<size_t>(out->axis);
    for (size_t i = 1; i < out->inputs.size(); ++i) {
      if (!tensors_.IsComputed(out->inputs[i])) op.Fail("joins what is not computed");
      std::vector<int> piece = Shape(out->inputs[i]);
      if (piece.size() != shape.size()) op.Fail("joins tensors with different numbers of axes");
      const int size = piece[axis];
      piece[axis] = shape[axis];
      if (piece != shape) op.Fail("joins tensors that differ along other axes too");
      shape[axis] += size;
    }
    tensors_.ExpectShape(op, out->output, shape);
    ReadActivation(options, 1, out);
  }

  // Weights: output channels x height x width x input channels; depthwise: 1 x ... x channels.
  void ReadConv(const FlatTable& op, const Options& options, bool depthwise, GraphOp* out) {
    out->kind = depthwise ? OpKind::kDepthwiseConv : OpKind::kConv;
    ExpectInputs(op, *out, 3);
    tensors_.ExpectPicture(op, out->inputs[0]);
    tensors_.ExpectPicture(op, out->output);
    out->inputs[1] = tensors_.Weights(op, out->inputs[1]);
    out->inputs[2] = tensors_.Weights(op, out->inputs[2]);
    const int in_channels = Shape(out->inputs[0])[3];
    const int out_channels = Shape(out->output)[3];
    const std::vector<int>& weights = Shape(out->inputs[1]);
    if (weights.size() != 4) op.Fail("weights without 4 axes");
    out->kernel = {weights[1], weights[2]};
    out->stride = {Window(op, options, 2), Window(op, options, 1)};
    if (depthwise) {
      if (Option<std::int32_t>(options, 3) != 1 || in_channels != out_channels) {
        op.Fail("a depthwise convolution that changes the number of channels");
      }
      tensors_.ExpectShape(op, out->inputs[1], {1, weights[1], weights[2], in_channels});
    } else {
      tensors_.ExpectShape(op, out->inputs[1], {out_channels, weights[1], weights[2], in_channels});
    }
    tensors_.ExpectShape(op, out->inputs[2], {out_channels});
    const int dilation_field = depthwise ? 5 : 4;
    for (const int field : {dilation_field, dilation_field + 1}) {
      if (Option<std::int32_t>(options, field, 1) != 1) op.Fail("a dilated convolution");
    }
    ReadBorder(op, Option<std::int8_t>(options, 0), out);
    ReadActivation(options, depthwise ? 4 : 3, out);
    products_left_ -= tensors_.Count(out->output) * (tensors_.Count(out->inputs[1]) / out_channels);
    if (products_left_ < 0) op.Fail("the network is slower than any pose network");
  }

  // Pads of a window that slides over height and width, and the shape that must come out.
  void ReadBorder(const FlatTable& op, int padding, GraphOp* out) {
    if (padding != kSame && padding != kValid) op.Fail(fmt::format("padding {}", padding));
    const std::vector<int>& in = Shape(out->inputs[0]);
    std::vector<int> shape = {1, 0, 0, Shape(out->output)[3]};
    for (size_t d = 0; d < 2; ++d) {
      const int size = in[d + 1];
      const int stride = out->stride[d];
      const int kernel = out->kernel[d];
      if (kernel > kMaxWindow) op.Fail(fmt::format("a window of {}", kernel));
      if (padding == kSame) {
        shape[d + 1] = (size + stride - 1) / stride;
        const int missing = std::max(0, (shape[d + 1] - 1) * stride + kernel - size);
        out->pads[d] = {missing / 2, missing - missing / 2};
      } else {
        if (kernel > size) op.Fail(fmt::format("a window of {} on a picture of {}", kernel, size));
        shape[d + 1] = (size - kernel) / stride + 1;
      }
    }
    tensors_.ExpectShape(op, out->output, shape);
  }

  void ReadMaxPool(const FlatTable& op, const Options& options, GraphOp* out) {
    out->kind = OpKind::kMaxPool;
    tensors_.ExpectPicture(op, out->inputs[0]);
    tensors_.ExpectPicture(op, out->output);
    if (Shape(out->output)[3] != Shape(out->inputs[0])[3]) op.Fail("a pooling that loses channels");
    if (Option<std::int8_t>(options, 0) != kValid) op.Fail("a pooling with padding");
    out->stride = {Window(op, options, 2), Window(op, options, 1)};
    out->kernel = {Window(op, options, 4), Window(op, options, 3)};
    ReadBorder(op, kValid, out);
    ReadActivation(options, 5, out);
  }

  void ReadDepthToSpace(const FlatTable& op, const Options& options, GraphOp* out) {
    out->kind = OpKind::kDepthToSpace;
    tensors_.ExpectPicture(op, out->inputs[0]);
    out->block = Window(op, options, 0);
    const std::vector<int>& in = Shape(out->inputs[0]);
    const int area = out->block * out->block;
    if (in[3] % area != 0) op.Fail(fmt::format("{} channels in blocks of {}", in[3], area));
    tensors_.ExpectShape(op, out->output,
                         {1, in[1] * out->block, in[2] * out->block, in[3] / area});
  }

  void ReadReshape(const FlatTable& op, GraphOp* out) {
    out->kind = OpKind::kReshape;
    if (tensors_.Count(out->inputs[0]) != tensors_.Count(out->output)) {
      op.Fail("a new shape for another number of values");
    }
    // Pictures change their order of axes on the way into cv::dnn; back into one is not needed.
    if (Shape(out->output).size() == 4) {
      throw Error(ErrorCode::kUnsupported, fmt::format("{}: reshapes to 4 axes", file_->name));
    }
  }

  void ReadResize(const FlatTable& op, const Options& options, GraphOp* out) {
    out->kind = OpKind::kResizeBilinear;
    ExpectInputs(op, *out, 2);
    tensors_.ExpectPicture(op, out->inputs[0]);
    if (Option<std::uint8_t>(options, 2) != 0 || Option<std::uint8_t>(options, 3) == 0) {
      throw Error(ErrorCode::kUnsupported,
                  fmt::format("{}: resizes without half-pixel centres", file_->name));
    }
    const std::vector<std::int32_t> size = tensors_.Ints(op, out->inputs[1], 2);
    tensors_.ExpectShape(op, out->output, {1, size[0], size[1], Shape(out->inputs[0])[3]});
  }

  void ReadPad(const FlatTable& op, GraphOp* out) {
    out->kind = OpKind::kPad;
    ExpectInputs(op, *out, 2);
    tensors_.ExpectPicture(op, out->inputs[0]);
    const std::vector<std::int32_t> pads = tensors_.Ints(op, out->inputs[1], 8);
    std::vector<int> shape = Shape(out->inputs[0]);
    for (size_t d = 0; d < 4; ++d) {
      const std::array<int, 2> pad = {pads[2 * d], pads[2 * d + 1]};
      for (const int size : pad) {
        if (size < 0 || size > (d == 0 ? 0 : kMaxPad)) op.Fail(fmt::format("a pad of {}", size));
      }
      if (d > 0) out->pads[d - 1] = pad;
      shape[d] += pad[0] + pad[1];
    }
    tensors_.ExpectShape(op, out->output, shape);
  }

  const FlatBytes* file_;
  FlatVector codes_;
  FlatTable subgraph_;
  TfliteTensors tensors_;
  std::int64_t computed_left_ = kMaxComputedValues;
  std::int64_t products_left_ = kMaxProducts;
  Graph graph_;
};

}  // namespace

bool IsTflite(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 8 && std::memcmp(bytes.data() + 4, "TFL3", 4) == 0;
}

Graph ReadTflite(std::span<const std::uint8_t> bytes, const std::string& name) {
  const FlatBytes file = {bytes, name};
  if (!IsTflite(bytes)) file.Fail(4, "no TensorFlow Lite file (its mark TFL3 is not there)");
  return Reader(&file, FlatTable(&file, file.Follow(0))).Read();
}

}  // namespace mpc::internal
