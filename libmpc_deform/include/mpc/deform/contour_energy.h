// Purpose: E_con of the pose: the model's outline on the silhouette.
// Source: paper, Section 5.2, Eq. 11:
//   E_con = 1/|S| sum_k [ n_k^T (Pi(v_k(S_f)) - s_k) ]^2
// Residual: distance of a vertex from the line through its target across the normal, times
// sqrt(weight / |S|). Unit: px of a picture whose longer side is 1920. Rows: C.
// Symbols: C correspondences, N dofs.
#pragma once

#include <Eigen/Core>

#include "mpc/core/camera.h"
#include "mpc/deform/correspondences.h"
#include "mpc/deform/refinement_point.h"

namespace mpc {

class ContourEnergy {
 public:
  // robust_px: distances e (px of 1920) count as e^2 / (1 + e^2 / robust_px^2); 0: squares (paper).
  // Refers to both arguments, which must outlive it.
  ContourEnergy(const Camera& camera, const Correspondences& correspondences, double robust_px);

  int num_residuals() const { return correspondences_->size(); }

  // False when a vertex cannot be projected: behind the camera, or beyond the lens model.
  bool Evaluate(const RefinementPoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

 private:
  const Camera* camera_;
  const Correspondences* correspondences_;
  double scale_;  // px of 1920 per px
  double robust_px_;
};

}  // namespace mpc
