// Purpose: feet that stand do not move along the viewing ray, where one camera hardly sees motion,
// and no foot goes through the floor.
// Source: ours (docs/pose.md, "Standing feet"); off in the paper preset.
// Rows: one per joint, mm: sqrt(weight) 1000 (ray . J - range_m), one-sided ones 0 where that is negative.
#pragma once

#include <vector>

#include "mpc/pose/energy.h"

namespace mpc {

struct StandingJoint {
  int joint = 0;                                   // index into Skeleton::joints
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  // from the camera to the joint, unit, body axes
  double range_m = 0;                              // where along it the joint stands
  double weight = 1;
  // Only what lies beyond counts: the floor, along a ray straight down.
  bool one_sided = false;
};

class StandingEnergy {
 public:
  StandingEnergy() = default;
  // robust_scale: Geman-McClure c of the unweighted residual, mm, 0 for none.
  StandingEnergy(std::vector<StandingJoint> joints, double robust_scale);

  int num_residuals() const { return static_cast<int>(joints_.size()); }
  bool Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

  // Some joints only: joint_index gives each joint's new index or -1.
  StandingEnergy Restricted(const std::vector<int>& joint_index) const;

  const std::vector<StandingJoint>& joints() const { return joints_; }

 private:
  std::vector<StandingJoint> joints_;
  double robust_scale_ = 0;
};

}  // namespace mpc
