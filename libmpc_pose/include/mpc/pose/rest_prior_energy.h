// Purpose: a weak pull of the hinge angles towards a relaxed pose, for dofs no joint observes (head
// and limb twists) and against needless bending.
// Source: ours; weight 0 in the paper preset.
// Rows: one per hinge, rad: sqrt(weight_h) r / sqrt(1 + (r / width_h)^2), r = theta_h - rest_h
// (Geman-McClure): people stay near rest or do something else, and then its distance says nothing.
#pragma once

#include <vector>

#include "mpc/pose/energy.h"

namespace mpc {

class RestPriorEnergy {
 public:
  RestPriorEnergy() = default;
  // One entry per hinge; empty widths: plain squares.
  RestPriorEnergy(Eigen::VectorXd rest_rad, const Eigen::VectorXd& weights,
                  const Eigen::VectorXd& widths_rad = {});

  // The rows of some hinges only.
  RestPriorEnergy Restricted(const std::vector<int>& hinges) const;

  int num_residuals() const { return static_cast<int>(rest_rad_.size()); }
  bool Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

 private:
  Eigen::VectorXd rest_rad_;
  Eigen::VectorXd sqrt_weights_;
  Eigen::VectorXd inverse_widths_;  // 0: plain squares
};

}  // namespace mpc
