// Purpose: E_3d exactly as in the paper, with the unknown translation t_f eliminated.
// Source: paper, Section 4, E_3d. min over t_f is attained at the mean difference, so the residual
// compares the two joint sets after removing their means (variable projection, exact).
// Rows: three per joint, mm: sqrt(weight) 1000 ((J_i - d_i) - mean_k (J_k - d_k)).
#pragma once

#include <vector>

#include "mpc/pose/energy.h"

namespace mpc {

class JointPositionEnergy {
 public:
  JointPositionEnergy() = default;
  // joints: indices into Skeleton::joints; positions 3 x |joints| in metres, axes of the body frame.
  JointPositionEnergy(std::vector<int> joints, Eigen::Matrix3Xd positions, double weight);

  int num_residuals() const { return 3 * static_cast<int>(joints_.size()); }
  bool Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

 private:
  std::vector<int> joints_;
  Eigen::Matrix3Xd positions_;
  double weight_ = 0;
};

}  // namespace mpc
