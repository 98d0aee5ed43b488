#include "net_builder.h"

#include <array>
#include <utility>

namespace mpc::internal {
namespace {

using cv::dnn::DictValue;
using cv::dnn::LayerParams;

DictValue Ints(const std::vector<int>& values) {
  return DictValue::arrayInt(values.begin(), static_cast<int>(values.size()));
}

// Axis of a picture in TFLite's order, in OpenCV's.
int PictureAxis(int axis) { return std::array{0, 2, 3, 1}[static_cast<size_t>(axis)]; }

class Builder {
 public:
  explicit Builder(Graph graph) : graph_(std::move(graph)), layers_(graph_.tensors.size(), -1) {
    layers_[static_cast<size_t>(graph_.input)] = 0;  // the net's own input layer
    for (const GraphOp& op : graph_.ops) Add(op);
  }

  BuiltNet Take() {
    BuiltNet built;
    for (const int output : graph_.outputs) {
      const int layer = layers_[static_cast<size_t>(output)];
      // A name of its own: the layer before an activation is fused away. Identity copies.
      built.outputs.push_back(net_.getLayer(layer)->name);
    }
    built.net = net_;
    return built;
  }

 private:
  const std::vector<int>& Shape(int tensor) const {
    return graph_.tensors[static_cast<size_t>(tensor)].shape;
  }

  // Adds a layer that takes the results of `sources`; returns its number.
  int AddLayer(const std::string& type, LayerParams params, const std::vector<int>& sources) {
    params.type = type;
    params.name = type + std::to_string(num_layers_++);
    const int layer = net_.addLayer(params.name, type, params);
    for (size_t i = 0; i < sources.size(); ++i) {
      net_.connect(sources[i], 0, layer, static_cast<int>(i));
    }
    return layer;
  }

  int AddPadding(const std::array<std::array<int, 2>, 3>& pads, int source) {
    const auto& [rows, columns, channels] = pads;
    LayerParams params;
    params.set("paddings",
               Ints({0, 0, channels[0], channels[1], rows[0], rows[1], columns[0], columns[1]}));
    return AddLayer("Padding", params, {source});
  }

  int AddReshape(const std::vector<int>& shape, int source) {
    LayerParams params;
    params.set("dim", Ints(shape));
    return AddLayer("Reshape", params, {source});
  }

  int AddPermute(const std::vector<int>& order, int source) {
    LayerParams params;
    params.set("order", Ints(order));
    return AddLayer("Permute", params, {source});
  }

  // Of output channels x height x width x input channels; depthwise 1 x height x width x channels.
  cv::Mat WeightsForOpenCv(const GraphOp& op) {
    GraphTensor& tensor = graph_.tensors[static_cast<size_t>(op.inputs[1])];
    const int groups = op.kind == OpKind::kConv ? tensor.shape[0] : 1;
    const int area = op.kernel[0] * op.kernel[1];
    const int channels = tensor.shape[3];
    const std::vector<int> shape = op.kind == OpKind::kConv
                                       ? std::vector{groups, channels, op.kernel[0], op.kernel[1]}
                                       : std::vector{channels, 1, op.kernel[0], op.kernel[1]};
    cv::Mat weights(shape, CV_32F);
    const float* from = tensor.values.data();
    auto* const to = weights.ptr<float>();
    for (int o = 0; o < groups; ++o) {
      for (int p = 0; p < area; ++p) {
        for (int c = 0; c < channels; ++c) to[(o * channels + c) * area + p] = *from++;
      }
    }
    return weights;
  }

  int AddConvolution(const GraphOp& op, int source) {
    const int channels = Shape(op.output)[3];
    const bool symmetric = op.pads[0][0] == op.pads[0][1] && op.pads[1][0] == op.pads[1][1];
    if (!symmetric) source = AddPadding(op.pads, source);  // which OpenCV's convolution refuses
    LayerParams params;
    params.set("num_output", channels);
    params.set("group", op.kind == OpKind::kDepthwiseConv ? channels : 1);
    params.set("kernel_h", op.kernel[0]);
    params.set("kernel_w", op.kernel[1]);
    params.set("stride_h", op.stride[0]);
    params.set("stride_w", op.stride[1]);
    params.set("pad_h", symmetric ? op.pads[0][0] : 0);
    params.set("pad_w", symmetric ? op.pads[1][0] : 0);
    params.set("bias_term", true);
    const std::vector<float>& bias = graph_.tensors[static_cast<size_t>(op.inputs[2])].values;
    params.blobs = {WeightsForOpenCv(op), cv::Mat(bias, /*copyData=*/true)};
    return AddLayer("Convolution", params, {source});
  }

  int AddMaxPool(const GraphOp& op, int source) {
    LayerParams params;
    params.set("pool", "max");
    params.set("kernel_h", op.kernel[0]);
    params.set("kernel_w", op.kernel[1]);
    params.set("stride_h", op.stride[0]);
    params.set("stride_w", op.stride[1]);
    params.set("ceil_mode", false);
    return AddLayer("Pooling", params, {source});
  }

  int AddResize(const GraphOp& op, int source) {
    LayerParams params;
    params.set("interpolation", "bilinear");
    params.set("half_pixel_centers", true);
    params.set("align_corners", false);
    params.set("height", Shape(op.output)[1]);
    params.set("width", Shape(op.output)[2]);
    return AddLayer("Resize", params, {source});
  }

  int AddDepthToSpace(const GraphOp& op, int source) {
    const std::vector<int>& in = Shape(op.inputs[0]);
    const std::vector<int>& out = Shape(op.output);
    source = AddReshape({1, op.block, op.block, out[3], in[1], in[2]}, source);
    source = AddPermute({0, 3, 4, 1, 5, 2}, source);
    return AddReshape({1, out[3], out[1], out[2]}, source);
  }

  int AddConcat(const GraphOp& op, const std::vector<int>& sources) {
    LayerParams params;
    params.set("axis", Shape(op.output).size() == 4 ? PictureAxis(op.axis) : op.axis);
    return AddLayer("Concat", params, sources);
  }

  int AddKind(const GraphOp& op, const std::vector<int>& sources) {
    switch (op.kind) {
      case OpKind::kAdd: {
        LayerParams params;
        params.set("operation", "sum");
        return AddLayer("Eltwise", params, sources);
      }
      case OpKind::kConcat:
        return AddConcat(op, sources);
      case OpKind::kConv:
      case OpKind::kDepthwiseConv:
        return AddConvolution(op, sources[0]);
      case OpKind::kDepthToSpace:
        return AddDepthToSpace(op, sources[0]);
      case OpKind::kLogistic:
        return AddLayer("Sigmoid", {}, sources);
      case OpKind::kMaxPool:
        return AddMaxPool(op, sources[0]);
      case OpKind::kPad:
        return AddPadding(op.pads, sources[0]);
      case OpKind::kReshape: {
        const bool is_picture = Shape(op.inputs[0]).size() == 4;
        return AddReshape(Shape(op.output),
                          is_picture ? AddPermute({0, 2, 3, 1}, sources[0]) : sources[0]);
      }
      case OpKind::kResizeBilinear:
        return AddResize(op, sources[0]);
    }
    return -1;
  }

  void Add(const GraphOp& op) {
    std::vector<int> sources;  // constants have no layer
    for (const int input : op.inputs) {
      const int layer = layers_[static_cast<size_t>(input)];
      if (layer >= 0) sources.push_back(layer);
    }
    int layer = AddKind(op, sources);
    if (op.relu6) {
      LayerParams params;
      params.set("min_value", 0);
      params.set("max_value", 6);
      layer = AddLayer("ReLU6", params, {layer});
    }
    layers_[static_cast<size_t>(op.output)] = layer;
  }

  Graph graph_;
  cv::dnn::Net net_;
  std::vector<int> layers_;  // of each computed tensor
  int num_layers_ = 0;
};

}  // namespace

BuiltNet BuildNet(Graph graph) { return Builder(std::move(graph)).Take(); }

}  // namespace mpc::internal
