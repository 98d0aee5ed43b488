#include "mpc/eval/surface_metrics.h"

#include <fmt/format.h>

#include "mpc/core/error.h"
#include "mpc/core/units.h"
#include "mpc/eval/closest_point.h"

namespace mpc {
namespace {

void RequireSameVertices(const Eigen::Matrix3Xf& a, const Eigen::Matrix3Xf& b) {
  if (a.cols() != b.cols() || a.cols() == 0) {
    throw Error(
        ErrorCode::kMismatch,
        fmt::format("surfaces of {} and {} vertices cannot be compared", a.cols(), b.cols()));
  }
}

// Mean distance of points + translation from a surface, metres.
double MeanDistance(const Eigen::Matrix3Xf& points, const Eigen::Vector3d& translation,
                    const SurfaceTree& surface) {
  double sum = 0;
  int nearest = 0;
  for (const auto& point : points.colwise()) {
    sum += surface.Distance(point.cast<double>() + translation, &nearest);
  }
  return sum / static_cast<double>(points.cols());
}

}  // namespace

Eigen::Vector3d MeanOffset(const Eigen::Matrix3Xf& estimate, const Eigen::Matrix3Xf& truth) {
  RequireSameVertices(estimate, truth);
  return (truth.cast<double>() - estimate.cast<double>()).rowwise().mean();
}

double MeanVertexDistanceMm(const Eigen::Matrix3Xf& estimate, const Eigen::Matrix3Xf& truth,
                            const Eigen::Vector3d& translation) {
  RequireSameVertices(estimate, truth);
  const Eigen::Matrix3Xd offset =
      (estimate.cast<double>() - truth.cast<double>()).colwise() + translation;
  return kMmPerMetre * offset.colwise().norm().mean();
}

SurfaceError CompareSurfaces(const Eigen::Matrix3Xf& estimate, const Eigen::Matrix3Xf& truth,
                             const Triangles& triangles, const Eigen::Vector3d& translation) {
  SurfaceError error;
  error.vertex_mm = MeanVertexDistanceMm(estimate, truth, translation);
  // Moving the points against the translation is the same as moving the surface along it.
  const double to_truth = MeanDistance(estimate, translation, SurfaceTree(truth, triangles));
  const double to_estimate = MeanDistance(truth, -translation, SurfaceTree(estimate, triangles));
  error.surface_mm = kMmPerMetre * 0.5 * (to_truth + to_estimate);
  return error;
}

}  // namespace mpc
