#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/render/model_mask.h"
#include "mpc/render/raster.h"
#include "screen.h"
#include "winding_image.h"

namespace mpc {
namespace {

constexpr int kSides = 32;          // around the axis
constexpr int kRingsPerSphere = 9;  // from a pole to the rim, both included
constexpr int kVerticesPerCapsule = 2 * kRingsPerSphere * kSides;
constexpr int kTrianglesPerCapsule = 2 * (2 * kRingsPerSphere - 1) * kSides;

// The convex hull of two spheres as a surface of revolution: part of sphere a, a cone, part of b.
// Both spheres meet the cone at the same angle from the axis.
void AddCapsule(const Capsule& capsule, int index, Eigen::Matrix3Xf* positions,
                Triangles* triangles) {
  const Eigen::Vector3d axis = capsule.b - capsule.a;
  const double length = axis.norm();
  const bool one_sphere = length <= std::abs(capsule.radius_a - capsule.radius_b);
  const bool a_is_larger = capsule.radius_a >= capsule.radius_b;
  // Within one sphere both ends are the larger sphere, cut at its equator.
  const Eigen::Vector3d a = one_sphere && !a_is_larger ? capsule.b : capsule.a;
  const Eigen::Vector3d b = one_sphere && a_is_larger ? capsule.a : capsule.b;
  const double radius_a =
      one_sphere ? std::max(capsule.radius_a, capsule.radius_b) : capsule.radius_a;
  const double radius_b = one_sphere ? radius_a : capsule.radius_b;
  const Eigen::Vector3d direction =
      one_sphere ? Eigen::Vector3d::UnitZ().eval() : (axis / length).eval();
  // Angle from the forward axis at which the cone touches.
  const double rim = std::acos(one_sphere ? 0 : (capsule.radius_a - capsule.radius_b) / length);
  const Eigen::Vector3d u = direction.unitOrthogonal();
  const Eigen::Vector3d v = direction.cross(u);

  const int first_vertex = index * kVerticesPerCapsule;
  int column = first_vertex;
  for (int ring = 0; ring < 2 * kRingsPerSphere; ++ring) {
    const bool on_a = ring < kRingsPerSphere;
    const double part =
        static_cast<double>(on_a ? ring : ring - kRingsPerSphere) / (kRingsPerSphere - 1);
    const double polar =
        on_a ? std::numbers::pi + part * (rim - std::numbers::pi) : rim * (1 - part);
    for (int side = 0; side < kSides; ++side) {
      const double around = 2 * std::numbers::pi * side / kSides;
      const Eigen::Vector3d normal =
          std::cos(polar) * direction +
          std::sin(polar) * (std::cos(around) * u + std::sin(around) * v);
      positions->col(column++) =
          (on_a ? a + radius_a * normal : b + radius_b * normal).cast<float>();
    }
  }
  int triangle = index * kTrianglesPerCapsule;
  for (int ring = 0; ring + 1 < 2 * kRingsPerSphere; ++ring) {
    for (int side = 0; side < kSides; ++side) {
      const int here = first_vertex + ring * kSides + side;
      const int next = first_vertex + ring * kSides + (side + 1) % kSides;
      triangles->col(triangle++) << here, next, here + kSides;
      triangles->col(triangle++) << next, next + kSides, here + kSides;
    }
  }
}

void CheckCapsules(const CapsuleSet& capsules) {
  for (size_t i = 0; i < capsules.size(); ++i) {
    if (capsules[i].radius_a >= 0 && capsules[i].radius_b >= 0) continue;
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("capsule {} has radii {} and {}", i, capsules[i].radius_a,
                            capsules[i].radius_b));
  }
}

// All capsules as one mesh.
void CapsuleMesh(const CapsuleSet& capsules, Eigen::Matrix3Xf* positions, Triangles* triangles) {
  const auto count = static_cast<Eigen::Index>(capsules.size());
  positions->resize(3, count * kVerticesPerCapsule);
  triangles->resize(3, count * kTrianglesPerCapsule);
  for (int i = 0; i < static_cast<int>(count); ++i) {
    AddCapsule(capsules[static_cast<size_t>(i)], i, positions, triangles);
  }
}

// The rim of a sphere as seen: the circle where rays touch it. The sphere must not reach the camera.
void AddRim(const Eigen::Vector3d& centre, double radius, int first, Eigen::Matrix3Xf* rim) {
  const double distance_sq = centre.squaredNorm();
  const double nearer = radius * radius / distance_sq;
  const double rim_radius = radius * std::sqrt(1 - nearer);
  const Eigen::Vector3d u = centre.unitOrthogonal();
  const Eigen::Vector3d v = centre.normalized().cross(u);
  for (int side = 0; side < kSides; ++side) {
    const double around = 2 * std::numbers::pi * side / kSides;
    rim->col(first + side) =
        ((1 - nearer) * centre + rim_radius * (std::cos(around) * u + std::sin(around) * v))
            .cast<float>();
  }
}

// Andrew's monotone chain, clockwise as seen. Sorts the points.
std::vector<ScreenVertex> ConvexHull(std::vector<ScreenVertex>* points) {
  std::sort(points->begin(), points->end(), [](const ScreenVertex& a, const ScreenVertex& b) {
    return std::pair(a.x, a.y) < std::pair(b.x, b.y);
  });
  std::vector<ScreenVertex> hull;
  const auto add = [&hull](size_t keep, const ScreenVertex& p) {
    while (hull.size() > keep && DoubleArea(hull[hull.size() - 2], hull.back(), p) <= 0) {
      hull.pop_back();
    }
    hull.push_back(p);
  };
  for (const ScreenVertex& p : *points) add(1, p);
  const size_t half = hull.size();
  for (size_t i = points->size() - 1; i-- > 0;) add(half, (*points)[i]);
  return hull;
}

// The outline of a capsule, a convex polygon; empty when it reaches the near plane or lies too far
// outside the picture.
std::vector<ScreenVertex> CapsuleOutline(const Camera& camera, const Capsule& capsule,
                                         double near_m) {
  if (!(capsule.a.z() - capsule.radius_a >= near_m && capsule.b.z() - capsule.radius_b >= near_m)) {
    return {};
  }
  Eigen::Matrix3Xf rims(3, 2 * kSides);
  AddRim(capsule.a, capsule.radius_a, 0, &rims);
  AddRim(capsule.b, capsule.radius_b, kSides, &rims);
  std::vector<ScreenVertex> points = ProjectVertices(camera, rims, near_m);
  for (const ScreenVertex& p : points) {
    if (p.state != VertexState::kVisible) return {};
  }
  return ConvexHull(&points);
}

}  // namespace

void RasterizeCapsules(const Camera& camera, const CapsuleSet& capsules_in_camera,
                       const RasterOptions& options, RasterBuffers* buffers) {
  CheckCapsules(capsules_in_camera);
  Eigen::Matrix3Xf positions;
  Triangles triangles;
  CapsuleMesh(capsules_in_camera, &positions, &triangles);
  RasterizeMesh(camera, positions, triangles, options, buffers);
  buffers->triangle_id.forEach<int>([](int& id, const int*) {
    if (id >= 0) id /= kTrianglesPerCapsule;
  });
}

cv::Mat CapsuleMask(const Camera& camera, const CapsuleSet& capsules_in_camera) {
  CheckArguments(camera, {}, 0);
  CheckCapsules(capsules_in_camera);
  const double near_m = RasterOptions().near_m;
  std::vector<std::vector<ScreenVertex>> outlines;
  std::vector<ScreenVertex> all;
  CapsuleSet without_outline;
  for (const Capsule& capsule : capsules_in_camera) {
    outlines.push_back(CapsuleOutline(camera, capsule, near_m));
    all.insert(all.end(), outlines.back().begin(), outlines.back().end());
    if (outlines.back().empty()) without_outline.push_back(capsule);
  }
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  const cv::Rect bounds = ScreenBounds(camera, all);
  if (!bounds.empty()) {
    WindingImage winding(bounds);
    for (const std::vector<ScreenVertex>& outline : outlines) winding.AddFan(outline);
    winding.Resolve(mask(bounds));
  }
  if (!without_outline.empty()) {
    RasterBuffers buffers;
    RasterizeCapsules(camera, without_outline, {}, &buffers);
    mask |= buffers.triangle_id >= 0;
  }
  return mask;
}

cv::Mat SkeletonMask(const Camera& camera, const CapsuleSet& capsules_in_camera, double thickness,
                     const cv::Mat& model) {
  if (!(thickness >= 0)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("thickness {} of limbs is negative", thickness));
  }
  if (model.type() != CV_8UC1 || model.cols != camera.width || model.rows != camera.height) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("a mask of {} x {} for a camera of {} x {} (8-bit, one channel)",
                            model.cols, model.rows, camera.width, camera.height));
  }
  CheckCapsules(capsules_in_camera);
  const double half_pixel = 0.5 / std::min(camera.fx, camera.fy);  // at a depth of 1 m
  CapsuleSet limbs = capsules_in_camera;
  for (Capsule& limb : limbs) {
    limb.radius_a = std::max(thickness * limb.radius_a, half_pixel * limb.a.z());
    limb.radius_b = std::max(thickness * limb.radius_b, half_pixel * limb.b.z());
  }
  return CapsuleMask(camera, limbs) & model;
}

}  // namespace mpc
