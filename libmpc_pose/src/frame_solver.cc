#include "mpc/pose/frame_solver.h"

#include <Eigen/Cholesky>
#include <chrono>
#include <cmath>

#include "mpc/core/rigid.h"

namespace mpc {

SolveSummary SolveFrame(const Skeleton& skeleton, const FrameProblem& problem,
                        const FrameSolveOptions& options, Eigen::VectorXd* pose,
                        FrameSolveScratch* scratch) {
  const auto start = std::chrono::steady_clock::now();
  const int num_dofs = skeleton.num_dofs();
  const int num_fixed = options.fixed_root ? 6 : 0;
  const Eigen::VectorXd lower = skeleton.LowerBounds();
  const Eigen::VectorXd upper = skeleton.UpperBounds();
  PosePoint& current = scratch->current;
  PosePoint& trial = scratch->trial;
  current.pose = pose->cwiseMax(lower).cwiseMin(upper);
  current.root_rotation = ExpSO3(pose->segment<3>(3));
  current.fixed_root = trial.fixed_root = options.fixed_root;

  SolveSummary summary;
  const auto finish = [&](Termination termination) {
    *pose = current.pose;
    pose->segment<3>(3) = LogSO3(current.root_rotation);
    summary.termination = termination;
    summary.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return summary;
  };

  current.Update(skeleton, /*with_jacobian=*/true);
  double cost =
      EvaluateFrame(problem, current, &scratch->evaluation, &scratch->hessian, &scratch->gradient);
  summary.initial_cost = summary.final_cost = cost;
  if (!std::isfinite(cost)) return finish(Termination::kFailed);

  double damping = options.initial_damping;
  for (summary.iterations = 0; summary.iterations < options.max_iterations;) {
    const Eigen::MatrixXd& hessian = scratch->hessian;
    Eigen::VectorXd& step = scratch->step;
    scratch->damped = hessian;
    step = -scratch->gradient;
    // The root translation is in metres: the floor on the diagonal keeps free directions solvable.
    const double floor = 1e-9 * hessian.diagonal().maxCoeff() + 1e-300;
    step.head(num_fixed).setZero();
    for (int n = num_fixed; n < num_dofs; ++n) {
      const bool pinned = (current.pose[n] <= lower[n] && scratch->gradient[n] > 0) ||
                          (current.pose[n] >= upper[n] && scratch->gradient[n] < 0);
      if (pinned) {
        scratch->damped.row(n).setZero();
        scratch->damped.col(n).setZero();
        scratch->damped(n, n) = 1;
        step[n] = 0;
      } else {
        scratch->damped(n, n) += damping * (hessian(n, n) + floor) + floor;
      }
    }
    const int num_free = num_dofs - num_fixed;
    Eigen::Ref<Eigen::VectorXd> free_step = step.tail(num_free);
    Eigen::Ref<Eigen::MatrixXd> free_block = scratch->damped.bottomRightCorner(num_free, num_free);
    Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(free_block).solveInPlace(free_step);
    ++summary.iterations;
    trial.pose = (current.pose + step).cwiseMax(lower).cwiseMin(upper);
    trial.root_rotation = ExpSO3(step.segment<3>(3)) * current.root_rotation;
    double trial_cost = std::numeric_limits<double>::infinity();
    if (step.allFinite()) {
      trial.Update(skeleton, /*with_jacobian=*/false);
      trial_cost = EvaluateFrame(problem, trial, &scratch->evaluation);
    }
    if (trial_cost < cost) {
      const double decrease = (cost - trial_cost) / cost;
      std::swap(current, trial);
      cost = summary.final_cost = trial_cost;
      damping = std::max(damping / 5, 1e-8);
      if (decrease < options.relative_tolerance) return finish(Termination::kConverged);
      current.UpdateJacobian(skeleton);
      EvaluateFrame(problem, current, &scratch->evaluation, &scratch->hessian, &scratch->gradient);
    } else {
      damping *= 8;
      if (damping > 1e8) return finish(Termination::kNoStep);
    }
  }
  return finish(Termination::kMaxIterations);
}

}  // namespace mpc
