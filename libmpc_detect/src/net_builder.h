// Purpose: a cv::dnn::Net from a graph.
// Source: OpenCV's DNN layers; what they need beyond TFLite's operations: docs/detect.md.
#pragma once

#include <opencv2/dnn.hpp>
#include <string>
#include <vector>

#include "graph.h"

namespace mpc::internal {

struct BuiltNet {
  cv::dnn::Net net;  // takes 1 x channels x height x width
  // In the order of graph.outputs. A picture comes out as 1 x channels x height x width, any other
  // tensor with TFLite's shape.
  std::vector<std::string> outputs;
};

// The graph's weights are moved out of it.
BuiltNet BuildNet(Graph graph);

}  // namespace mpc::internal
