// Purpose: the residuals of one frame written once more for any scalar type: twin of the analytic
// Jacobians and baseline of the solvers.
// Units and order of rows: as FrameProblem's. Symbols: N dofs.
#pragma once

#include <ceres/jet.h>
#include <ceres/rotation.h>

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "mpc/pose/root_chart.h"
#include "mpc/skeleton/skeleton.h"
#include "pose/synthetic_batch.h"

namespace mpc::testing {

template <typename T>
using TwinVector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using TwinMatrix3 = Eigen::Matrix<T, 3, 3>;

template <typename T>
TwinMatrix3<T> TwinExp(const TwinVector3<T>& rotation_vector) {
  TwinMatrix3<T> rotation;
  ceres::AngleAxisToRotationMatrix(rotation_vector.data(), rotation.data());
  return rotation;
}

// RootChart::Rotation, from what the chart shows of itself.
template <typename T>
TwinMatrix3<T> TwinChartRotation(const RootChart& chart, const TwinVector3<T>& coordinates) {
  const Eigen::Matrix3d axes = chart.Jacobian(Eigen::Vector3d::Zero());
  const TwinVector3<T> turn = axes.col(0).cast<T>() * coordinates[0];
  const TwinVector3<T> tilt =
      axes.col(1).cast<T>() * coordinates[1] + axes.col(2).cast<T>() * coordinates[2];
  return TwinExp<T>(turn) * TwinExp<T>(tilt) * chart.Rotation(Eigen::Vector3d::Zero()).cast<T>();
}

// Joint positions; pose[3..5] is not read.
template <typename T>
std::vector<TwinVector3<T>> TwinJoints(const Skeleton& skeleton, const T* pose,
                                       const TwinMatrix3<T>& root_rotation) {
  std::vector<TwinMatrix3<T>> rotations = {root_rotation};
  std::vector<TwinVector3<T>> origins = {TwinVector3<T>(pose[0], pose[1], pose[2])};
  size_t h = 0;
  for (int s = 1; s < skeleton.num_segments(); ++s) {
    const Segment& segment = skeleton.segments[s];
    const TwinMatrix3<T>& parent = rotations[segment.parent];
    origins.push_back(origins[segment.parent] + parent * segment.offset.cast<T>());
    TwinMatrix3<T> rotation = parent * segment.rest_rotation.cast<T>();
    for (; h < skeleton.hinges.size() && skeleton.hinges[h].segment == s; ++h) {
      const TwinVector3<T> turn = skeleton.hinges[h].axis.cast<T>() * pose[6 + h];
      rotation = (rotation * TwinExp<T>(turn)).eval();
    }
    rotations.push_back(rotation);
  }
  std::vector<TwinVector3<T>> joints;
  for (const SkeletonJoint& joint : skeleton.joints) {
    joints.push_back(origins[joint.segment] +
                     rotations[joint.segment] * joint.x_in_segment.cast<T>());
  }
  return joints;
}

// Geman-McClure as a map of a residual block.
template <typename T, int kSize>
Eigen::Matrix<T, kSize, 1> TwinRobust(double c, const Eigen::Matrix<T, kSize, 1>& r) {
  if (c <= 0) return r;
  return r / sqrt(T(1) + r.squaredNorm() / (c * c));
}

// All rows of FrameIngredients::Problem.
template <typename T>
std::vector<T> TwinResiduals(const Skeleton& skeleton, const Camera& camera,
                             const FrameIngredients& frame, const T* pose,
                             const TwinMatrix3<T>& root_rotation) {
  const std::vector<TwinVector3<T>> x = TwinJoints(skeleton, pose, root_rotation);
  std::vector<T> rows;
  for (const Observation2d& point : frame.points) {
    const TwinVector3<T>& joint = x[point.joint];
    const T u = joint[0] / joint[2];
    const T v = joint[1] / joint[2];
    const T r2 = u * u + v * v;
    const auto& [k1, k2, p1, p2, k3] = camera.distortion;
    const T radial = T(1) + r2 * (k1 + r2 * (k2 + r2 * k3));
    const T du = u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u);
    const T dv = v * radial + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v;
    const double weight = std::sqrt(point.weight);
    const double scale = weight * frame.unit_per_px;
    const Eigen::Matrix<T, 2, 1> r(scale * (camera.fx * du + camera.cx - point.pixel.x()),
                                   scale * (camera.fy * dv + camera.cy - point.pixel.y()));
    for (const T& row : TwinRobust<T, 2>(weight * frame.robust_2d, r)) rows.push_back(row);
  }
  TwinVector3<T> mean = TwinVector3<T>::Zero();
  for (size_t i = 0; i < frame.joints.size(); ++i) {
    mean += (x[frame.joints[i]] - frame.positions.col(i).cast<T>()) /
            T(static_cast<double>(frame.joints.size()));
  }
  for (size_t i = 0; i < frame.joints.size(); ++i) {
    const TwinVector3<T> r = (x[frame.joints[i]] - frame.positions.col(i).cast<T>() - mean) *
                             T(1000 * std::sqrt(frame.weight_3d));
    for (const T& row : r) rows.push_back(row);
  }
  const BoneVectorWeights& weights = frame.bone_weights;
  const Eigen::Vector3d axes(weights.across, weights.across, weights.along);
  for (const BoneObservation& bone : frame.bones) {
    const Eigen::Matrix3d metric =
        1000 * std::sqrt(bone.weight) * axes.asDiagonal() * frame.body_from_ray.transpose();
    const TwinVector3<T> r = metric.cast<T>() * (x[bone.b] - x[bone.a] - bone.vector.cast<T>());
    const double c = std::sqrt(bone.weight) * weights.robust_scale;
    for (const T& row : TwinRobust<T, 3>(c, r)) rows.push_back(row);
  }
  for (Eigen::Index h = 0; h < frame.rest.size(); ++h) {
    rows.push_back((pose[6 + h] - frame.rest[h]) * std::sqrt(frame.rest_weights[h]));
  }
  return rows;
}

// The Jacobian of all rows, columns 3..5 a left rotation of the root.
inline Eigen::MatrixXd TwinJacobian(const Skeleton& skeleton, const Camera& camera,
                                    const FrameIngredients& frame, const Eigen::VectorXd& pose) {
  constexpr int kDofs = 33;
  using Jet = ceres::Jet<double, kDofs>;
  Eigen::Matrix<Jet, kDofs, 1> dofs;
  for (int n = 0; n < kDofs; ++n) dofs[n] = Jet(n >= 3 && n < 6 ? 0 : pose[n], n);
  const TwinVector3<Jet> tangent = dofs.segment<3>(3);
  const TwinMatrix3<Jet> root = TwinExp<Jet>(tangent) * ExpSO3(pose.segment<3>(3)).cast<Jet>();
  const std::vector<Jet> rows = TwinResiduals<Jet>(skeleton, camera, frame, dofs.data(), root);
  Eigen::MatrixXd jacobian(rows.size(), kDofs);
  for (size_t r = 0; r < rows.size(); ++r) jacobian.row(r) = rows[r].v.transpose();
  return jacobian;
}

}  // namespace mpc::testing
