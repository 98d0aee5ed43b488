// Purpose: what every energy of pose refinement shares: the point it is evaluated at.
// Frames: the body frame is the camera's. Units: metres, radians; residuals as each energy states.
// Symbols: N dofs, J joints, R residuals.
//
// An energy is a value class with
//   int num_residuals() const;
//   bool Evaluate(const RefinementPoint& at, int first_row, Eigen::VectorXd* r,
//                 Eigen::MatrixXd* jacobian) const;
// It writes num_residuals() entries of r from first_row on and, if given, the same columns of
// `jacobian` (N x R: one column per residual; entries 3..5 a left rotation of the root). The term's
// cost is the squared norm of its residuals: weights and robust losses are inside. Evaluate returns
// false outside the energy's domain.
#pragma once

#include <Eigen/Core>

#include "mpc/core/rigid.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning_jacobian.h"

namespace mpc {

// A pose with its kinematics. Refers to the character, which must outlive it.
struct RefinementPoint {
  explicit RefinementPoint(const Character& character) : skinner(character) {}

  // R <- root_rotation; entries 3..5 of the pose are ignored.
  void Set(const Skeleton& skeleton, const Eigen::VectorXd& new_pose,
           const Eigen::Matrix3d& new_root_rotation) {
    pose = new_pose;
    root_rotation = new_root_rotation;
    ForwardKinematics(skeleton, pose, root_rotation, &state);
    skinner.Update(state);
  }

  Eigen::VectorXd pose;  // N
  Eigen::Matrix3d root_rotation = Eigen::Matrix3d::Identity();
  KinematicState state;
  VertexSkinner skinner;
  Eigen::MatrixXd joint_jacobian;  // 3J x N, JointJacobian; valid where derivatives are asked for
};

}  // namespace mpc
