// Purpose: E_stab: the refined pose stays near the batch's.
// Source: paper, Section 5.2, Eq. 12:
//   w_stab E_stab = w_stab / N_d sum_i | J_i(S_f) - J_i(S^_f) |^2
// over the paper's N_d = 16 joints. Ours, 1 in `paper`: differences along the viewing ray through
// J_i(S^_f) count `along_ray` times, because a silhouette says little about depth.
// Residual: sqrt(w_stab / N_d) times the difference. Unit: mm. Rows: 3 per joint.
// Symbols: N dofs, J joints.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/deform/refinement_point.h"

namespace mpc {

class StabilityEnergy {
 public:
  // `batch_pose` (N) is S^_f. Throws Error (kInvalidArgument) for a wrong size.
  StabilityEnergy(const Skeleton& skeleton, const Eigen::VectorXd& batch_pose, double weight,
                  double along_ray);

  int num_residuals() const { return 3 * static_cast<int>(joints_.size()); }

  // Always true.
  bool Evaluate(const RefinementPoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

 private:
  std::vector<int> joints_;                            // of the skeleton, those of the paper
  Eigen::Matrix3Xd reference_;                         // 3xJ: J_i(S^_f)
  std::vector<Eigen::Matrix3d> residual_from_metres_;  // J
};

}  // namespace mpc
