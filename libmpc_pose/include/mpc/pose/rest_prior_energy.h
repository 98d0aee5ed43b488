// Purpose: a weak pull of the hinge angles towards a relaxed pose, for dofs no joint observes (head
// and limb twists) and against needless bending.
// Source: ours; weight 0 in the paper preset.
// Rows: one per hinge, rad: sqrt(weight_h) (theta_h - rest_h).
#pragma once

#include <vector>

#include "mpc/pose/energy.h"

namespace mpc {

class RestPriorEnergy {
 public:
  RestPriorEnergy() = default;
  // rest and weights have one entry per hinge.
  RestPriorEnergy(Eigen::VectorXd rest_rad, Eigen::VectorXd weights);

  // The rows of some hinges only.
  RestPriorEnergy Restricted(const std::vector<int>& hinges) const;

  int num_residuals() const { return static_cast<int>(rest_rad_.size()); }
  bool Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

 private:
  Eigen::VectorXd rest_rad_;
  Eigen::VectorXd sqrt_weights_;
};

}  // namespace mpc
