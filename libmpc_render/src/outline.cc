#include "outline.h"

#include <fmt/format.h>

#include <algorithm>

#include "mpc/core/error.h"

namespace mpc {

Outline ComputeOutline(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                       const SurfaceTopology& topology, double near_m) {
  CheckArguments(camera, {}, 0);
  const auto num_vertices = static_cast<Eigen::Index>(topology.vertex_begin.size()) - 1;
  if (positions_in_camera.cols() != num_vertices) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{} positions for a topology of {} vertices",
                            positions_in_camera.cols(), num_vertices));
  }
  Outline outline;
  outline.vertices = ProjectVertices(camera, positions_in_camera, near_m);
  const Triangles& triangles = topology.triangles;
  outline.side_sign.resize(static_cast<size_t>(2 * triangles.cols()));
  int8_t* sign = outline.side_sign.data();
  for (int t = 0; t < triangles.cols(); ++t, sign += 2) {
    const ScreenVertex& a = outline.vertices[static_cast<size_t>(triangles(0, t))];
    const ScreenVertex& b = outline.vertices[static_cast<size_t>(triangles(1, t))];
    const ScreenVertex& c = outline.vertices[static_cast<size_t>(triangles(2, t))];
    const VertexState state = std::max({a.state, b.state, c.state});
    if (state == VertexState::kNeedsClipping) outline.clipped.push_back(t);
    if (state != VertexState::kVisible) continue;
    const int64_t area = DoubleArea(a, b, c);
    sign[0] = static_cast<int8_t>((area > 0) - (area < 0));
    sign[1] = static_cast<int8_t>(-sign[0]);
  }
  return outline;
}

}  // namespace mpc
