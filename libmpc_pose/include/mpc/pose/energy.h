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

#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

// A pose with its kinematics.
struct PosePoint {
  Eigen::VectorXd pose;  // N; entries 3..5 are ignored in favour of root_rotation
  Eigen::Matrix3d root_rotation = Eigen::Matrix3d::Identity();  // body_from_root
  KinematicState state;
  Eigen::MatrixXd joint_jacobian;  // 3J x N; valid where derivatives are asked for

  void Update(const Skeleton& skeleton, bool with_jacobian);
};

// Geman-McClure robust loss as a map of a residual block: r -> r / sqrt(1 + |r|^2 / c^2), so that
// the squared norm becomes rho = |r|^2 / (1 + |r|^2 / c^2) <= c^2. Applied to rows [first_row,
// first_row + size) of r and, exactly, of the Jacobian. c <= 0: plain squares, nothing changes.
void ApplyRobustLoss(double c, int first_row, int size, Eigen::VectorXd* r,
                     Eigen::MatrixXd* jacobian);

}  // namespace mpc
