#include "mpc/deform/refinement_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "mpc/core/rigid.h"

namespace mpc {
namespace {

// Minimises the damped quadratic model over steps that stay within [least, most]: dofs that would
// leave are held at their bound, and the others solved again around them.
void SolveWithinBounds(const Eigen::MatrixXd& damped, const Eigen::VectorXd& gradient,
                       const Eigen::VectorXd& least, const Eigen::VectorXd& most,
                       Eigen::VectorXd* step) {
  const Eigen::Index num_dofs = gradient.size();
  std::vector<bool> held(static_cast<size_t>(num_dofs), false);
  step->setZero(num_dofs);
  const auto hold = [&](Eigen::Index n, double value) {
    held[static_cast<size_t>(n)] = true;
    (*step)[n] = value;
  };
  for (Eigen::Index n = 0; n < num_dofs; ++n) {
    if ((least[n] >= 0 && gradient[n] > 0) || (most[n] <= 0 && gradient[n] < 0)) hold(n, 0);
  }
  for (bool again = true; again;) {
    again = false;
    Eigen::MatrixXd matrix = damped;
    Eigen::VectorXd right = -gradient;
    for (Eigen::Index n = 0; n < num_dofs; ++n) {
      if (!held[static_cast<size_t>(n)]) continue;
      right -= (*step)[n] * damped.col(n);
      matrix.row(n).setZero();
      matrix.col(n).setZero();
      matrix(n, n) = 1;
    }
    for (Eigen::Index n = 0; n < num_dofs; ++n) {
      if (held[static_cast<size_t>(n)]) right[n] = (*step)[n];
    }
    *step = matrix.llt().solve(right);
    for (Eigen::Index n = 0; n < num_dofs; ++n) {
      if (held[static_cast<size_t>(n)] || ((*step)[n] >= least[n] && (*step)[n] <= most[n])) {
        continue;
      }
      hold(n, (*step)[n] < least[n] ? least[n] : most[n]);
      again = std::isfinite((*step)[n]);
    }
  }
}

}  // namespace

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
      hessian.triangularView<Eigen::StrictlyUpper>() = hessian.transpose();
      gradient.noalias() = jacobian * r;
      linearised = true;
    }
    // What nothing observes stays where it is.
    const double floor = 1e-9 * hessian.diagonal().maxCoeff() + 1e-300;
    damped = hessian;
    damped.diagonal().array() += damping * (hessian.diagonal().array() + floor) + floor;
    SolveWithinBounds(damped, gradient, lower - current.pose, upper - current.pose, &step);
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
    const double predicted = -step.dot(2 * gradient + hessian * step) / cost;
    std::swap(current, trial);
    cost = trial_cost;
    damping = std::max(damping / 5, 1e-8);
    // A step that did less than it promised shows a bad model, not the end.
    if (std::max(decrease, predicted) < relative_tolerance) break;
    if (solve.steps < max_steps) problem.Evaluate(&current, &r, &jacobian);
    linearised = false;
  }
  solve.final_cost = cost;
  *pose = current.pose;
  pose->segment<3>(3) = LogSO3(current.root_rotation);
  return solve;
}

}  // namespace mpc
