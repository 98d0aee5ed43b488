// Purpose: forward kinematics of a capture skeleton and its analytic Jacobians.
// Source: paper, Section 4: J_i(S). Jacobian columns are hinge axis times lever arm.
// Frames: "body" is whatever frame the pose's root lives in: the camera frame in the solvers.
// Units: metres, radians. Symbols: S segments, H hinges, J joints, N dofs.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/skeleton/skeleton.h"

namespace mpc {

// Everything forward kinematics knows about one pose. Reuse one object: after the first call with a
// skeleton nothing allocates.
struct KinematicState {
  std::vector<Eigen::Matrix3d> rotations;  // S: body_from_segment
  Eigen::Matrix3Xd origins;                // 3xS: segment origins
  Eigen::Matrix3Xd hinge_axes;             // 3xH, unit, in the body frame
  Eigen::Matrix3Xd joints;                 // 3xJ
  std::vector<int> hinge_begin;            // S+1: hinges of segment s are [begin[s], begin[s+1])
};

// Computes the state of a pose (N). The overload with a matrix takes the root rotation from
// `root_rotation` and ignores pose[3..5]. Throws Error (kInvalidArgument) for a wrong size.
void ForwardKinematics(const Skeleton& skeleton, const Eigen::VectorXd& pose,
                       KinematicState* state);
void ForwardKinematics(const Skeleton& skeleton, const Eigen::VectorXd& pose,
                       const Eigen::Matrix3d& root_rotation, KinematicState* state);

// d joints / d pose, 3J x N, joint i in rows 3i..3i+2. Columns 3..5 are the derivative with respect
// to a left rotation of the root, R <- exp(w) R, in rad about the body frame's axes (so they are
// free of the rotation vector's singularities). Sizes `jacobian`; allocates only when it grows.
void JointJacobian(const Skeleton& skeleton, const KinematicState& state,
                   Eigen::MatrixXd* jacobian);

// The same for one point fixed in a segment and given in the body frame: 3 x N written to
// `jacobian`, which must have that size.
void PointJacobian(const Skeleton& skeleton, const KinematicState& state, int segment,
                   const Eigen::Vector3d& x_in_body, Eigen::Ref<Eigen::MatrixXd> jacobian);

// True when hinge h moves segment s (it lies on the chain from the root to s), H x S.
Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> HingeInfluence(const Skeleton& skeleton);

// Joint positions of several poses (N x F): 3J x F.
Eigen::MatrixXd JointTrajectories(const Skeleton& skeleton, const Eigen::MatrixXd& poses);

}  // namespace mpc
