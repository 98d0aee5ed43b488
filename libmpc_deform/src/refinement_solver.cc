#include "mpc/deform/refinement_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "mpc/core/rigid.h"

namespace mpc {

double RefinementProblem::Evaluate(RefinementPoint* at, Eigen::VectorXd* r,
                                   Eigen::MatrixXd* jacobian) const {
  r->resize(num_residuals());
  if (jacobian != nullptr) {
    jacobian->resize(character_->skeleton.num_dofs(), num_residuals());
    JointJacobian(character_->skeleton, at->state, &at->joint_jacobian);
  }
  if (!contour_.Evaluate(*at, 0, r, jacobian) ||
      !stability_.Evaluate(*at, contour_.num_residuals(), r, jacobian)) {
    return std::numeric_limits<double>::infinity();
  }
  return r->squaredNorm();
}

RefinementSolve SolveRefinement(const RefinementProblem& problem, double relative_tolerance,
                                int max_steps, Eigen::VectorXd* pose) {
  const Skeleton& skeleton = problem.character().skeleton;
  const int num_dofs = skeleton.num_dofs();
  const Eigen::VectorXd lower = skeleton.LowerBounds(), upper = skeleton.UpperBounds();
  RefinementPoint current(problem.character()), trial(problem.character());
  Eigen::VectorXd r, gradient(num_dofs), step(num_dofs);
  Eigen::MatrixXd jacobian, hessian(num_dofs, num_dofs), damped;

  RefinementSolve solve;
  current.Set(skeleton, pose->cwiseMax(lower).cwiseMin(upper), ExpSO3(pose->segment<3>(3)));
  double cost = solve.initial_cost = problem.Evaluate(&current, &r, &jacobian);
  solve.failed = !std::isfinite(cost);
  if (solve.failed) return solve;

  bool linearised = false;
  double damping = 1e-3;
  while (solve.steps < max_steps && damping < 1e8) {
    if (!linearised) {
      hessian.setZero();
      hessian.selfadjointView<Eigen::Lower>().rankUpdate(jacobian);
      gradient.noalias() = jacobian * r;
      linearised = true;
    }
    damped = hessian;
    step = -gradient;
    // What nothing observes stays where it is.
    const double floor = 1e-9 * hessian.diagonal().maxCoeff() + 1e-300;
    for (int n = 0; n < num_dofs; ++n) {
      const bool pinned = (current.pose[n] <= lower[n] && gradient[n] > 0) ||
                          (current.pose[n] >= upper[n] && gradient[n] < 0);
      if (pinned) {
        damped.row(n).setZero();
        damped.col(n).setZero();
        damped(n, n) = 1;
        step[n] = 0;
      } else {
        damped(n, n) += damping * (hessian(n, n) + floor) + floor;
      }
    }
    Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(damped).solveInPlace(step);
    ++solve.steps;
    double trial_cost = std::numeric_limits<double>::infinity();
    if (step.allFinite()) {
      trial.Set(skeleton, (current.pose + step).cwiseMax(lower).cwiseMin(upper),
                ExpSO3(step.segment<3>(3)) * current.root_rotation);
      trial_cost = problem.Evaluate(&trial, &r, nullptr);
    }
    if (!(trial_cost < cost)) {
      damping *= 8;
      continue;
    }
    const double decrease = (cost - trial_cost) / cost;
    std::swap(current, trial);
    cost = trial_cost;
    damping = std::max(damping / 5, 1e-8);
    if (decrease < relative_tolerance) break;
    if (solve.steps < max_steps) problem.Evaluate(&current, &r, &jacobian);
    linearised = false;
  }
  solve.final_cost = cost;
  *pose = current.pose;
  pose->segment<3>(3) = LogSO3(current.root_rotation);
  return solve;
}

}  // namespace mpc
