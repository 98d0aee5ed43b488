// Purpose: what every per-frame pose energy shares: the point it is evaluated at, the rows it fills.
// Source: paper, Section 4, E_pose = E_2d + w_3d E_3d + w_d E_d. E_d couples frames and lives in
// batch_solver.h; the terms of this interface see one frame.
// Units: residuals in millimetres, radians, or pixels. Symbols: N dofs, J joints, R residuals.
//
// An energy is a value class with
//   int num_residuals() const;
//   bool Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
//                 Eigen::MatrixXd* jacobian) const;
// It writes num_residuals() entries of r from first_row on and, if given, the same rows of
// `jacobian` (R x N with respect to the pose; columns 3..5 a left rotation of the root; rows come
// in zeroed). The term's cost is the squared norm of its rows: weights and robust losses are inside,
// so every solver sees plain least squares. Evaluate returns false outside the energy's domain.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

// A pose with its kinematics.
struct PosePoint {
  Eigen::VectorXd pose;  // N; entries 3..5 are ignored in favour of root_rotation
  Eigen::Matrix3d root_rotation = Eigen::Matrix3d::Identity();  // body_from_root
  bool fixed_root = false;  // the root does not move: its dofs are not in joint_dofs
  KinematicState state;
  // Valid where derivatives are asked for:
  Eigen::MatrixXd joint_jacobian;            // 3J x N
  std::vector<std::vector<int>> joint_dofs;  // J: the dofs that move the joint, ascending

  void Update(const Skeleton& skeleton, bool with_jacobian);
  void UpdateJacobian(const Skeleton& skeleton);  // the state is current already
};

// Keeps the terms of a part of the skeleton's joints: joint_index gives each joint's index in the part
// or -1. A term has the field `joint`.
template <typename Term>
void RestrictToJoints(const std::vector<int>& joint_index, std::vector<Term>* terms) {
  std::erase_if(*terms, [&](const Term& term) { return joint_index[term.joint] < 0; });
  for (Term& term : *terms) term.joint = joint_index[term.joint];
}

// Geman-McClure robust loss as a map of a residual block: r -> r / sqrt(1 + |r|^2 / c^2), so that
// the squared norm becomes rho = |r|^2 / (1 + |r|^2 / c^2) <= c^2. `derivative`, if given, is that of
// r by anything and is mapped exactly. c <= 0: plain squares, nothing changes.
template <int kRows>
void ApplyRobustLoss(double c, Eigen::Ref<Eigen::Matrix<double, kRows, 1>> r,
                     Eigen::Matrix<double, kRows, 3>* derivative) {
  if (c <= 0) return;
  const double q = 1 / (1 + r.squaredNorm() / (c * c));
  const double scale = std::sqrt(q);
  if (derivative != nullptr) {
    // d (s r) = s (I - q r r^T / c^2) dr with s = q^(1/2).
    const Eigen::RowVector3d along = q / (c * c) * (r.transpose() * *derivative);
    *derivative = scale * (*derivative - r * along);
  }
  r *= scale;
}

}  // namespace mpc
