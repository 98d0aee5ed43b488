#include "mpc/pose/batch_oracle.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "mpc/core/rigid.h"
#include "mpc/pose/root_chart.h"

namespace mpc {
namespace {

constexpr int kRoundIterations = 3;  // see SolveBatchCeres

using RowMajorMap =
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

// The energies of one frame as Ceres sees them: a block of N chart coordinates.
class FrameCost : public ceres::CostFunction {
 public:
  FrameCost(const Skeleton& skeleton, const RootChart& chart, const FrameProblem& problem)
      : skeleton_(skeleton), chart_(chart), problem_(problem) {
    set_num_residuals(problem.num_residuals());
    mutable_parameter_block_sizes()->push_back(skeleton.num_dofs());
  }

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const int num_dofs = skeleton_.num_dofs();
    const bool with_jacobian = jacobians != nullptr && jacobians[0] != nullptr;
    const Eigen::Vector3d turn(parameters[0] + 3);
    PosePoint point;
    point.pose = Eigen::Map<const Eigen::VectorXd>(parameters[0], num_dofs);
    point.root_rotation = chart_.Rotation(turn);
    point.Update(skeleton_, with_jacobian);
    FrameScratch scratch;
    Eigen::MatrixXd hessian;
    Eigen::VectorXd gradient;
    const double cost = with_jacobian
                            ? EvaluateFrame(problem_, point, &scratch, &hessian, &gradient)
                            : EvaluateFrame(problem_, point, &scratch);
    if (!std::isfinite(cost)) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()) = scratch.residuals;
    if (with_jacobian) {
      RowMajorMap jacobian(jacobians[0], num_residuals(), num_dofs);
      jacobian = scratch.jacobian;
      jacobian.middleCols<3>(3) = scratch.jacobian.middleCols<3>(3) * chart_.Jacobian(turn);
    }
    return true;
  }

 private:
  const Skeleton& skeleton_;
  const RootChart& chart_;
  const FrameProblem& problem_;
};

// weight (S_nf - sum_k C_nk D_kf): blocks S_f (N) and C_n (K).
class SubspaceRow : public ceres::CostFunction {
 public:
  SubspaceRow(int dof, int num_dofs, const Eigen::VectorXd& basis_column, double weight)
      : dof_(dof), basis_column_(basis_column), weight_(weight) {
    set_num_residuals(1);
    *mutable_parameter_block_sizes() = {num_dofs, static_cast<int>(basis_column.size())};
  }

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Eigen::VectorXd> coefficients(parameters[1], basis_column_.size());
    residuals[0] = weight_ * (parameters[0][dof_] - coefficients.dot(basis_column_));
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      std::fill_n(jacobians[0], parameter_block_sizes()[0], 0.0);
      jacobians[0][dof_] = weight_;
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::VectorXd>(jacobians[1], basis_column_.size()) = -weight_ * basis_column_;
    }
    return true;
  }

 private:
  int dof_;
  Eigen::VectorXd basis_column_;
  double weight_;
};

// diag(weights) C_n.
class BandRows : public ceres::CostFunction {
 public:
  explicit BandRows(const Eigen::VectorXd& weights) : weights_(weights) {
    set_num_residuals(static_cast<int>(weights.size()));
    mutable_parameter_block_sizes()->push_back(num_residuals());
  }

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const int size = num_residuals();
    Eigen::Map<Eigen::VectorXd>(residuals, size) =
        weights_.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(parameters[0], size));
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      RowMajorMap(jacobians[0], size, size) = weights_.asDiagonal().toDenseMatrix();
    }
    return true;
  }

 private:
  Eigen::VectorXd weights_;
};

// Makes the dofs constant that lie at a bound with the gradient pressing against it.
void HoldActiveBounds(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                      Eigen::MatrixXd* s, ceres::Problem* problem) {
  for (Eigen::Index f = 0; f < s->cols(); ++f) problem->SetManifold(s->col(f).data(), nullptr);
  ceres::Problem::EvaluateOptions blocks;
  for (Eigen::Index f = 0; f < s->cols(); ++f) blocks.parameter_blocks.push_back(s->col(f).data());
  std::vector<double> gradient;
  problem->Evaluate(blocks, nullptr, nullptr, &gradient, nullptr);
  for (Eigen::Index f = 0; f < s->cols(); ++f) {
    std::vector<int> held;
    for (Eigen::Index n = 0; n < s->rows(); ++n) {
      const double slope = gradient[static_cast<size_t>(f * s->rows() + n)];
      const bool pressed =
          ((*s)(n, f) <= lower[n] && slope > 0) || ((*s)(n, f) >= upper[n] && slope < 0);
      if (pressed) held.push_back(static_cast<int>(n));
    }
    if (held.empty()) continue;
    problem->SetManifold(s->col(f).data(),
                         new ceres::SubsetManifold(static_cast<int>(s->rows()), held));
  }
}

Termination TerminationOf(const ceres::Solver::Summary& summary) {
  switch (summary.termination_type) {
    case ceres::CONVERGENCE:
      return Termination::kConverged;
    case ceres::NO_CONVERGENCE:
      return Termination::kMaxIterations;
    default:
      return Termination::kNoStep;
  }
}

}  // namespace

SolveSummary SolveBatchCeres(const BatchProblem& problem, const BatchOracleOptions& options,
                             Eigen::MatrixXd* poses) {
  const auto start = std::chrono::steady_clock::now();
  const int num_dofs = problem.skeleton.num_dofs();
  const int num_frames = static_cast<int>(problem.frames.size());
  const Eigen::VectorXd lower = problem.skeleton.LowerBounds();
  const Eigen::VectorXd upper = problem.skeleton.UpperBounds();

  std::vector<Eigen::Matrix3d> rotations(num_frames);
  for (int f = 0; f < num_frames; ++f) rotations[f] = ExpSO3(poses->block<3, 1>(3, f));
  const RootChart chart(rotations);
  Eigen::MatrixXd s = *poses;
  s.middleRows<3>(3) = chart.Coordinates(rotations);
  for (int f = 0; f < num_frames; ++f) {
    s.col(f) = s.col(f).cwiseMax(lower).cwiseMin(upper).eval();
  }

  // K x N: the best C for S, min over C_nk of (C_nk - (S D^T)_nk)^2 + band_nk C_nk^2.
  const Eigen::MatrixXd kept = 1 - problem.band_penalty.array();
  const Eigen::MatrixXd band = problem.band_penalty.array() / kept.array();
  Eigen::MatrixXd coefficients;
  const auto fit_coefficients = [&] {
    coefficients = kept.transpose().cwiseProduct(problem.basis * s.transpose());
  };
  fit_coefficients();

  ceres::Problem ceres_problem;
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (int f = 0; f < num_frames; ++f) {
    double* frame = s.col(f).data();
    ceres_problem.AddParameterBlock(frame, num_dofs);
    ordering->AddElementToGroup(frame, 0);
    for (int n = 0; n < num_dofs; ++n) {
      if (std::isfinite(lower[n])) ceres_problem.SetParameterLowerBound(frame, n, lower[n]);
      if (std::isfinite(upper[n])) ceres_problem.SetParameterUpperBound(frame, n, upper[n]);
    }
    if (problem.frames[f].num_residuals() > 0) {
      ceres_problem.AddResidualBlock(new FrameCost(problem.skeleton, chart, problem.frames[f]),
                                     nullptr, frame);
    }
    for (int n = 0; n < num_dofs; ++n) {
      ceres_problem.AddResidualBlock(
          new SubspaceRow(n, num_dofs, problem.basis.col(f), std::sqrt(problem.smoothness[n])),
          nullptr, frame, coefficients.col(n).data());
    }
  }
  for (int n = 0; n < num_dofs; ++n) {
    ordering->AddElementToGroup(coefficients.col(n).data(), 1);
    if (band.row(n).isZero(0)) continue;
    const Eigen::VectorXd stiffness = problem.smoothness[n] * band.row(n);
    ceres_problem.AddResidualBlock(new BandRows(stiffness.cwiseSqrt()), nullptr,
                                   coefficients.col(n).data());
  }
  const auto cost = [&] {
    double half_cost = 0;
    const bool inside = ceres_problem.Evaluate(ceres::Problem::EvaluateOptions(), &half_cost,
                                               nullptr, nullptr, nullptr);
    return inside ? 2 * half_cost : std::numeric_limits<double>::infinity();
  };

  SolveSummary summary;
  summary.initial_cost = summary.final_cost = cost();
  if (std::isfinite(summary.initial_cost)) {
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.linear_solver_ordering = ordering;
    solver.num_threads = 1;
    solver.function_tolerance = options.relative_tolerance;
    solver.gradient_tolerance = 0;
    solver.parameter_tolerance = 0;
    solver.initial_trust_region_radius = 1e8;
    solver.logging_type = ceres::SILENT;
    // Ceres clamps a step to the bounds after computing it without them, and stalls at the first
    // bound that matters. Rounds that hold fixed what presses against a bound get past it.
    while (summary.iterations < options.max_iterations) {
      HoldActiveBounds(lower, upper, &s, &ceres_problem);
      ceres::Solver::Summary outcome;
      solver.max_num_iterations =
          std::min(kRoundIterations, options.max_iterations - summary.iterations);
      ceres::Solve(solver, &ceres_problem, &outcome);
      summary.iterations += static_cast<int>(outcome.iterations.size()) - 1;
      summary.termination = TerminationOf(outcome);
      solver.initial_trust_region_radius = outcome.iterations.back().trust_region_radius;
      fit_coefficients();
      if (outcome.initial_cost - outcome.final_cost <=
          options.relative_tolerance * outcome.initial_cost) {
        break;
      }
    }
    summary.final_cost = cost();
  } else {
    summary.termination = Termination::kFailed;
  }
  *poses = s;
  for (int f = 0; f < num_frames; ++f) {
    poses->block<3, 1>(3, f) = LogSO3(chart.Rotation(s.block<3, 1>(3, f)));
  }
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace mpc
