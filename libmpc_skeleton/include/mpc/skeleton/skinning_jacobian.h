// Purpose: analytic derivative of dual-quaternion-skinned vertices with respect to the pose.
// Source: Kavan et al. 2007; paper, Section 5.2 (v_k(S_f) inside E_con).
// Units: metres, radians. Symbols: N dofs. Double precision: it feeds solvers.
#pragma once

#include <Eigen/Core>

#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {

// Position of one vertex (body frame, double) and, if `jacobian` is given, its derivative 3 x N
// with columns as in JointJacobian (columns 3..5: left rotation of the root). `jacobian` is sized
// by the function. O(K N). Throws Error (kInvalidArgument) for a vertex out of range.
Eigen::Vector3d SkinnedVertex(const Character& character, const KinematicState& state, int vertex,
                              Eigen::Matrix3Xd* jacobian = nullptr);

}  // namespace mpc
