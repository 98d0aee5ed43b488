#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "mpc/core/error.h"
#include "mpc/render/raster.h"

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

}  // namespace

void RasterizeCapsules(const Camera& camera, const CapsuleSet& capsules_in_camera,
                       const RasterOptions& options, RasterBuffers* buffers) {
  const auto count = static_cast<Eigen::Index>(capsules_in_camera.size());
  Eigen::Matrix3Xf positions(3, count * kVerticesPerCapsule);
  Triangles triangles(3, count * kTrianglesPerCapsule);
  for (int i = 0; i < static_cast<int>(count); ++i) {
    const Capsule& capsule = capsules_in_camera[i];
    if (!(capsule.radius_a >= 0 && capsule.radius_b >= 0)) {
      throw Error(ErrorCode::kInvalidArgument, fmt::format("capsule {} has radii {} and {}", i,
                                                           capsule.radius_a, capsule.radius_b));
    }
    AddCapsule(capsule, i, &positions, &triangles);
  }
  RasterizeMesh(camera, positions, triangles, options, buffers);
  buffers->triangle_id.forEach<int>([](int& id, const int*) {
    if (id >= 0) id /= kTrianglesPerCapsule;
  });
}

cv::Mat CapsuleMask(const Camera& camera, const CapsuleSet& capsules_in_camera) {
  RasterBuffers buffers;
  RasterizeCapsules(camera, capsules_in_camera, {}, &buffers);
  return buffers.triangle_id >= 0;
}

}  // namespace mpc
