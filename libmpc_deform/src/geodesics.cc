#include "geodesics.h"

#include <limits>

namespace mpc {

EdgeDistances::EdgeDistances(const Eigen::Matrix3Xf& positions, const Triangles& triangles)
    : begin_(positions.cols() + 1, 0),
      best_(positions.cols(), std::numeric_limits<float>::infinity()),
      done_(positions.cols(), 0) {
  const std::vector<MeshEdge> edges = MeshEdges(triangles);
  for (const MeshEdge& edge : edges) {
    ++begin_[edge.v0 + 1];
    ++begin_[edge.v1 + 1];
  }
  for (size_t v = 1; v < begin_.size(); ++v) begin_[v] += begin_[v - 1];
  edges_.resize(2 * edges.size());
  std::vector<int> end = begin_;
  for (const MeshEdge& edge : edges) {
    const float length = (positions.col(edge.v0) - positions.col(edge.v1)).norm();
    edges_[end[edge.v0]++] = {edge.v1, length};
    edges_[end[edge.v1]++] = {edge.v0, length};
  }
}

}  // namespace mpc
