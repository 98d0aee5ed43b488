// Purpose: which way the triangles of a mesh face, and the edges where that changes.
// Symbols: T triangles, V vertices.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/render/model_mask.h"
#include "screen.h"

namespace mpc {

struct Outline {
  std::vector<ScreenVertex> vertices;  // V
  // 2T, by side: 1 or -1 for the direction a triangle takes on its edges when counted positive; 0
  // for triangles that are edge-on, need clipping or cannot be drawn.
  std::vector<int8_t> side_sign;
  std::vector<int> clipped;  // triangles that need clipping

  // The weight of an edge in the picture's winding numbers; 0 where its faces face the same way.
  int Weight(const SurfaceTopology::Edge& edge) const {
    return side_sign[static_cast<size_t>(edge.side0)] +
           (edge.side1 < 0 ? 0 : side_sign[static_cast<size_t>(edge.side1)]);
  }
};

// Throws Error as ModelMask.
Outline ComputeOutline(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                       const SurfaceTopology& topology, double near_m);

// M from its outline: ModelMask.
void DrawOutlineMask(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                     const SurfaceTopology& topology, const Outline& outline, cv::Mat* mask);

}  // namespace mpc
