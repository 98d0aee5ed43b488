// Purpose: a network as plain data: what the TFLite reader gives and the builder of the
// cv::dnn::Net takes.
//
// Shapes are TFLite's: N x height x width x channels, batch 1. Constants are folded: operations
// that only decode weights are gone and every weight is a float. The shapes of every operation have
// been checked against each other, so a graph that was read can be run.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace mpc::internal {

struct GraphTensor {
  std::string name;
  std::vector<int> shape;     // all >= 1
  std::vector<float> values;  // of a constant; else empty
};

enum class OpKind {
  kAdd,
  kConcat,
  kConv,
  kDepthToSpace,
  kDepthwiseConv,
  kLogistic,
  kMaxPool,
  kPad,
  kReshape,
  kResizeBilinear,
};

struct GraphOp {
  OpKind kind = OpKind::kAdd;
  std::vector<int> inputs;  // tensors; of convolutions: picture, weights, bias
  int output = 0;
  bool relu6 = false;                  // applied to the result
  std::array<int, 2> stride = {1, 1};  // height, width
  std::array<int, 2> kernel = {1, 1};
  // Before and after height, width and channels: what a PAD adds, or a convolution at its border.
  std::array<std::array<int, 2>, 3> pads = {};
  int block = 0;  // of depth to space
  int axis = 0;   // of a concatenation
};

struct Graph {
  std::vector<GraphTensor> tensors;
  std::vector<GraphOp> ops;  // in an order in which they can run
  int input = 0;             // the one input, 1 x height x width x channels
  std::vector<int> outputs;
};

}  // namespace mpc::internal
