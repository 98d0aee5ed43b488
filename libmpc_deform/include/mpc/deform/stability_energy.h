// Purpose: E_stab: the refined pose stays near the batch's.
// Source: paper, Section 5.2, Eq. 12:
//   w_stab E_stab = w_stab / N_d sum_i | J_i(S_f) - J_i(S^_f) |^2
// over the paper's N_d = 16 joints. Ours: the joints' common move along the viewing ray counts only in
// part, because the batch knows it worst, and the size of the outline tells it.
// Residual: sqrt(w_stab / N_d) times the difference. Unit: mm. Rows: 3 per joint.
// Symbols: N dofs, J joints.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/deform/refinement_point.h"

namespace mpc {

class StabilityEnergy {
 public:
  // `batch_pose` (N) is S^_f. free_depth: this share of the mean difference along the ray to the
  // actor is taken from each difference; 0: paper. Throws Error (kInvalidArgument) for a wrong size.
  StabilityEnergy(const Skeleton& skeleton, const Eigen::VectorXd& batch_pose, double weight,
                  double free_depth);

  int num_residuals() const { return 3 * static_cast<int>(joints_.size()); }

  // Always true.
  bool Evaluate(const RefinementPoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

 private:
  std::vector<int> joints_;     // of the skeleton, those of the paper
  Eigen::Matrix3Xd reference_;  // 3xJ: J_i(S^_f)
  Eigen::Matrix3d free_;        // of the mean difference
  double scale_;                // residual per metre
};

}  // namespace mpc
