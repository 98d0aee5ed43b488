// Purpose: a mesh's vertices and triangles on the pixel grid, the common start of everything that
// is drawn.
// Frames: camera frame; pixel centres at integers. Units: metres; screen coordinates in 1/256 px.
// Symbols: V vertices, T triangles.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/triangle_mesh.h"

namespace mpc {

inline constexpr int kSubpixelBits = 8;
inline constexpr int kSubpixels = 1 << kSubpixelBits;
// Pixel coordinates are kept below this: screen coordinates fit into 29 bits, products of two
// differences into 64.
inline constexpr double kGuardPx = 1 << 20;

// The first pixel at or after, and the last at or before, a screen coordinate.
inline int CeilPixel(int x) { return (x + kSubpixels - 1) >> kSubpixelBits; }
inline int FloorPixel(int x) { return x >> kSubpixelBits; }

enum class VertexState : int32_t {
  kVisible,
  kNeedsClipping,  // behind the near plane, far outside the picture or beyond the lens model
  kUnusable,       // not finite
};

struct ScreenVertex {
  int x = 0;
  int y = 0;
  float inverse_z = 0;
  VertexState state = VertexState::kUnusable;
};

using ScreenTriangle = std::array<ScreenVertex, 3>;

// Twice the signed area of a triangle in (1/256 px)^2; positive when a, b, c run clockwise as seen.
inline int64_t DoubleArea(const ScreenVertex& a, const ScreenVertex& b, const ScreenVertex& c) {
  return static_cast<int64_t>(b.x - a.x) * (c.y - a.y) -
         static_cast<int64_t>(b.y - a.y) * (c.x - a.x);
}

// Throws Error (kInvalidArgument) for a bad camera, a picture that is too large, or a vertex index
// out of range.
void CheckArguments(const Camera& camera, const Triangles& triangles, Eigen::Index num_vertices);

// All vertices, V entries.
std::vector<ScreenVertex> ProjectVertices(const Camera& camera,
                                          const Eigen::Matrix3Xf& positions_in_camera,
                                          double near_m);

// What to do with a triangle: kVisible, draw its corners; kNeedsClipping, draw ClippedTriangle.
inline VertexState TriangleState(const ScreenTriangle& triangle) {
  return std::max({triangle[0].state, triangle[1].state, triangle[2].state});
}

// The visible part of a triangle as a convex polygon, in order; empty when nothing can be drawn.
std::vector<ScreenVertex> ClippedTriangle(const Camera& camera,
                                          const Eigen::Matrix3Xf& positions_in_camera,
                                          const Eigen::Vector3i& corners, double near_m);

// The pixels inside the vertices' bounding box, clipped to the picture; the whole picture when a
// vertex needs clipping.
cv::Rect ScreenBounds(const Camera& camera, const std::vector<ScreenVertex>& vertices);

}  // namespace mpc
