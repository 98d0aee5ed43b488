// Purpose: all energies of one frame, as cost and normal equations.
// Source: paper, Section 4: one frame's share of E_2d + w_3d E_3d, and ours.
// Symbols: N dofs. Units: as the energies'.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/pose/bone_vector_energy.h"
#include "mpc/pose/energy.h"
#include "mpc/pose/joint_position_energy.h"
#include "mpc/pose/reprojection_energy.h"
#include "mpc/pose/rest_prior_energy.h"
#include "mpc/pose/standing_energy.h"
#include "mpc/pose/track_prior_energy.h"

namespace mpc {

struct FrameProblem {
  ReprojectionEnergy reprojection;
  JointPositionEnergy joint_positions;  // the paper's E_3d; empty in the default
  BoneVectorEnergy bone_vectors;        // ours; empty in the paper preset
  StandingEnergy standing;              // ours
  RestPriorEnergy rest_prior;
  TrackPriorEnergy track_prior;  // empty but while frames are initialised one after the other

  int num_residuals() const;

  // The problem of a part of the skeleton: joint_index gives each joint's index in the part or -1,
  // `hinges` the part's hinges. E_3d as in the paper sees all joints at once and is left out.
  FrameProblem Restricted(const std::vector<int>& joint_index,
                          const std::vector<int>& hinges) const;
};

// Buffers of Evaluate, to be reused.
struct FrameScratch {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  std::vector<int> dofs;
};

// Cost (sum of squared residuals) at a point whose kinematics are current; infinity outside the
// domain. With `hessian` (N x N) and `gradient` (N) given also the Gauss-Newton normal equations of
// half the cost: J^T J and J^T r with columns 3..5 a left rotation of the root; at.joint_jacobian
// must then be current.
double EvaluateFrame(const FrameProblem& problem, const PosePoint& at, FrameScratch* scratch,
                     Eigen::MatrixXd* hessian = nullptr, Eigen::VectorXd* gradient = nullptr);

}  // namespace mpc
