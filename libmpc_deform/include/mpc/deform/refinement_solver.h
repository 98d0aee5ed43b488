// Purpose: the pose that fits given correspondences best, by our solver and by Ceres, its oracle.
// Source: paper, Section 5.2, Eq. 10: E_ref = E_con + w_stab E_stab. Projected Levenberg-Marquardt
// with an active set for the bounds of the angles.
// Units: of E_ref: px^2 of a picture whose longer side is 1920, and mm^2. Symbols: N dofs.
#pragma once

#include <Eigen/Core>

#include "mpc/deform/contour_energy.h"
#include "mpc/deform/stability_energy.h"

namespace mpc {

// E_ref with fixed correspondences. Refers to the character, which must outlive it.
class RefinementProblem {
 public:
  RefinementProblem(const Character& character, const ContourEnergy& contour,
                    const StabilityEnergy& stability)
      : character_(&character), contour_(contour), stability_(stability) {}

  const Character& character() const { return *character_; }
  int num_residuals() const { return contour_.num_residuals() + stability_.num_residuals(); }

  // Cost at a point, infinity outside the domain; sizes the residuals r and, if given, their
  // derivatives (N x R, see refinement_point.h), for which at->joint_jacobian is updated.
  double Evaluate(RefinementPoint* at, Eigen::VectorXd* r, Eigen::MatrixXd* jacobian) const;

 private:
  const Character* character_;
  ContourEnergy contour_;
  StabilityEnergy stability_;
};

struct RefinementSolve {
  bool failed = false;      // the start lies outside the domain; the pose is as it was
  double initial_cost = 0;  // of the pose clamped into the bounds
  double final_cost = 0;
  int steps = 0;
};

// Both improve `pose` (N) within the bounds of the skeleton, never making it worse than the start
// clamped into the bounds, and stop when a step lowers the cost by less than relative_tolerance.
RefinementSolve SolveRefinement(const RefinementProblem& problem, double relative_tolerance,
                                int max_steps, Eigen::VectorXd* pose);
RefinementSolve SolveRefinementCeres(const RefinementProblem& problem, double relative_tolerance,
                                     int max_steps, Eigen::VectorXd* pose);

}  // namespace mpc
