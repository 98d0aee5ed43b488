#include "mpc/pose/root_chart.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "mpc/core/rigid.h"

namespace mpc {
namespace {

// J_l with exp(v + d) = exp(J_l(v) d) exp(v) to first order.
Eigen::Matrix3d LeftJacobianSO3(const Eigen::Vector3d& v) {
  const double angle = v.norm();
  const Eigen::Matrix3d cross = CrossMatrix(v);
  if (angle < 1e-5) {
    return Eigen::Matrix3d::Identity() + 0.5 * cross + cross * cross / 6;
  }
  const double angle2 = angle * angle;
  return Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / angle2 * cross +
         (angle - std::sin(angle)) / (angle2 * angle) * cross * cross;
}

}  // namespace

RootChart::RootChart(const std::vector<Eigen::Matrix3d>& rotations) {
  mid_rotation_ = rotations[rotations.size() / 2];
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (size_t f = 1; f < rotations.size(); ++f) {
    const Eigen::Vector3d step = LogSO3(rotations[f] * rotations[f - 1].transpose());
    scatter += step * step.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  axis_ = eigen.eigenvectors().col(2);
  perpendicular_ << eigen.eigenvectors().col(0), eigen.eigenvectors().col(1);
}

Eigen::Matrix3Xd RootChart::Coordinates(const std::vector<Eigen::Matrix3d>& rotations) const {
  Eigen::Matrix3Xd coordinates(3, rotations.size());
  double previous = 0;
  for (size_t f = 0; f < rotations.size(); ++f) {
    // Swing-twist: Q = exp(psi a) exp(tau); the twist is the quaternion's part along a.
    const Eigen::Quaterniond q(rotations[f] * mid_rotation_.transpose());
    double psi = 2 * std::atan2(q.vec().dot(axis_), q.w());
    psi -= 2 * std::numbers::pi * std::round((psi - previous) / (2 * std::numbers::pi));
    previous = psi;
    const Eigen::Matrix3d swing = ExpSO3(-psi * axis_) * rotations[f] * mid_rotation_.transpose();
    coordinates(0, f) = psi;
    coordinates.col(f).tail<2>() = perpendicular_.transpose() * LogSO3(swing);
  }
  return coordinates;
}

Eigen::Matrix3d RootChart::Rotation(const Eigen::Vector3d& coordinates) const {
  return ExpSO3(coordinates[0] * axis_) * ExpSO3(perpendicular_ * coordinates.tail<2>()) *
         mid_rotation_;
}

Eigen::Matrix3d RootChart::Jacobian(const Eigen::Vector3d& coordinates) const {
  Eigen::Matrix3d jacobian;
  jacobian.col(0) = axis_;
  jacobian.rightCols<2>() = ExpSO3(coordinates[0] * axis_) *
                            LeftJacobianSO3(perpendicular_ * coordinates.tail<2>()) *
                            perpendicular_;
  return jacobian;
}

}  // namespace mpc
