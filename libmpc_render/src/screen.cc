#include "screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr int kMaxSide = 16384;

bool HasDistortion(const Camera& camera) {
  return std::any_of(camera.distortion.begin(), camera.distortion.end(),
                     [](double k) { return k != 0; });
}

// False when the point cannot be drawn as it is. `pinhole`: the camera has no distortion.
bool ToScreen(const Camera& camera, bool pinhole, const Eigen::Vector3d& x, ScreenVertex* vertex) {
  Eigen::Vector2d pixel;
  if (pinhole) {
    const double inverse_z = 1 / x.z();
    pixel = {camera.fx * (x.x() * inverse_z) + camera.cx,
             camera.fy * (x.y() * inverse_z) + camera.cy};
  } else if (!Project(camera, x, &pixel)) {
    return false;
  }
  if (!(std::abs(pixel.x()) < kGuardPx && std::abs(pixel.y()) < kGuardPx)) return false;
  vertex->x = cvRound(pixel.x() * kSubpixels);
  vertex->y = cvRound(pixel.y() * kSubpixels);
  vertex->inverse_z = static_cast<float>(1 / x.z());
  vertex->state = VertexState::kVisible;
  return true;
}

// Keeps the part of a convex polygon where normal . x >= offset. A crossing is always computed from
// the inner to the outer end, so that two triangles with a common edge get the same point.
void ClipAgainst(const Eigen::Vector3d& normal, double offset,
                 std::vector<Eigen::Vector3d>* polygon) {
  std::vector<Eigen::Vector3d> kept;
  for (size_t i = 0; i < polygon->size(); ++i) {
    const Eigen::Vector3d& from = (*polygon)[i];
    const Eigen::Vector3d& to = (*polygon)[(i + 1) % polygon->size()];
    const double from_distance = normal.dot(from) - offset;
    const double to_distance = normal.dot(to) - offset;
    if (from_distance >= 0) kept.push_back(from);
    if ((from_distance >= 0) == (to_distance >= 0)) continue;
    const bool leaving = from_distance >= 0;
    const Eigen::Vector3d& in = leaving ? from : to;
    const Eigen::Vector3d& out = leaving ? to : from;
    const double in_distance = leaving ? from_distance : to_distance;
    const double out_distance = leaving ? to_distance : from_distance;
    kept.push_back(in + in_distance / (in_distance - out_distance) * (out - in));
  }
  polygon->swap(kept);
}

}  // namespace

void CheckArguments(const Camera& camera, const Triangles& triangles, Eigen::Index num_vertices) {
  camera.Validate();
  if (camera.width > kMaxSide || camera.height > kMaxSide) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("a picture of {} x {} is larger than {} on a side", camera.width,
                            camera.height, kMaxSide));
  }
  if (triangles.size() > 0 && (triangles.minCoeff() < 0 || triangles.maxCoeff() >= num_vertices)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("triangles use vertices {} to {} of a mesh that has {}",
                            triangles.minCoeff(), triangles.maxCoeff(), num_vertices));
  }
}

std::vector<ScreenVertex> ProjectVertices(const Camera& camera,
                                          const Eigen::Matrix3Xf& positions_in_camera,
                                          double near_m) {
  // Project refuses what is nearer than a micrometre.
  const double nearest = std::max(near_m, 1e-6);
  const bool pinhole = !HasDistortion(camera);
  std::vector<ScreenVertex> vertices(static_cast<size_t>(positions_in_camera.cols()));
  for (size_t i = 0; i < vertices.size(); ++i) {
    const Eigen::Vector3d x = positions_in_camera.col(static_cast<Eigen::Index>(i)).cast<double>();
    if (!x.allFinite()) continue;
    if (!(x.z() >= nearest) || !ToScreen(camera, pinhole, x, &vertices[i])) {
      vertices[i].state = VertexState::kNeedsClipping;
    }
  }
  return vertices;
}

std::vector<ScreenVertex> ClippedTriangle(const Camera& camera,
                                          const Eigen::Matrix3Xf& positions_in_camera,
                                          const Eigen::Vector3i& corners, double near_m) {
  std::vector<Eigen::Vector3d> polygon;
  for (const int v : corners) polygon.push_back(positions_in_camera.col(v).cast<double>());
  ClipAgainst(Eigen::Vector3d::UnitZ(), std::max(near_m, 1e-6), &polygon);
  // The tangent of the widest angle whose pixels stay inside the guard band.
  const double reach_x = (0.5 * kGuardPx - std::abs(camera.cx)) / camera.fx;
  const double reach_y = (0.5 * kGuardPx - std::abs(camera.cy)) / camera.fy;
  ClipAgainst({1, 0, reach_x}, 0, &polygon);
  ClipAgainst({-1, 0, reach_x}, 0, &polygon);
  ClipAgainst({0, 1, reach_y}, 0, &polygon);
  ClipAgainst({0, -1, reach_y}, 0, &polygon);
  const bool pinhole = !HasDistortion(camera);
  std::vector<ScreenVertex> screen(polygon.size());
  for (size_t i = 0; i < polygon.size(); ++i) {
    if (!ToScreen(camera, pinhole, polygon[i], &screen[i])) return {};
  }
  return screen;
}

cv::Rect ScreenBounds(const Camera& camera, const std::vector<ScreenVertex>& vertices) {
  int min_x = std::numeric_limits<int>::max(), max_x = std::numeric_limits<int>::min();
  int min_y = min_x, max_y = max_x;
  for (const ScreenVertex& v : vertices) {
    if (v.state == VertexState::kNeedsClipping) return {0, 0, camera.width, camera.height};
    if (v.state == VertexState::kUnusable) continue;
    min_x = std::min(min_x, v.x);
    max_x = std::max(max_x, v.x);
    min_y = std::min(min_y, v.y);
    max_y = std::max(max_y, v.y);
  }
  if (min_x > max_x) return {};
  const cv::Point begin(std::max(0, CeilPixel(min_x)), std::max(0, CeilPixel(min_y)));
  const cv::Point end(std::min(camera.width, FloorPixel(max_x) + 1),
                      std::min(camera.height, FloorPixel(max_y) + 1));
  if (begin.x >= end.x || begin.y >= end.y) return {};
  return {begin, end};
}

}  // namespace mpc
