// Purpose: three smooth numbers for the root rotation over a batch, over any number of turns.
// Source: ours (DESIGN "Root rotation under Ed"): a wrapped rotation vector jumps at pi.
// R_f = exp(psi_f a) exp(tau_f) R_0 with R_0 the mid-frame rotation, a the dominant axis of the
// frame-to-frame rotations, psi unwrapped, tau_f perpendicular to a (two numbers).
// Units: radians. Symbols: F frames.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace mpc {

class RootChart {
 public:
  // Chooses R_0 and a for a sequence of rotations (at least one).
  explicit RootChart(const std::vector<Eigen::Matrix3d>& rotations);

  // (psi, tau_1, tau_2) of every frame, 3 x F, psi unwrapped along the sequence.
  Eigen::Matrix3Xd Coordinates(const std::vector<Eigen::Matrix3d>& rotations) const;

  Eigen::Matrix3d Rotation(const Eigen::Vector3d& coordinates) const;

  // d w / d coordinates where R <- exp(w) R, 3x3.
  Eigen::Matrix3d Jacobian(const Eigen::Vector3d& coordinates) const;

 private:
  Eigen::Matrix3d mid_rotation_;               // R_0
  Eigen::Vector3d axis_;                       // a
  Eigen::Matrix<double, 3, 2> perpendicular_;  // spans the plane of tau
};

}  // namespace mpc
