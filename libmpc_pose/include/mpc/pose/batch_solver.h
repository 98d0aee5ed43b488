// Purpose: the product solver of the batch pose problem.
// Source: paper, Section 4, Eq. (opt): min sum of the frames' energies + w_d E_d within hard bounds
// on the angles. With D the DCT basis, E_d = min over C of |Lambda (S - C D)|^2 (docs/pose.md), so
// the frames couple only through the N x K coefficients C: one Schur complement per iteration.
// Units: as the energies'. Symbols: N dofs, F frames, K basis vectors.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/pose/frame_problem.h"
#include "mpc/pose/summary.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

struct BatchProblem {
  Skeleton skeleton;
  std::vector<FrameProblem> frames;  // F
  Eigen::MatrixXd basis;             // K x F, orthonormal rows
  // N: w_d lambda^2 per dof; root translation per m^2, root rotation (in chart coordinates of
  // root_chart.h) and angles per rad^2. All positive.
  Eigen::VectorXd smoothness;
  // N x K: share in [0, 1) of that weight on coefficient k inside the subspace; zeros in the paper.
  Eigen::MatrixXd band_penalty;
};

struct BatchSolveOptions {
  int max_iterations = 30;
  double relative_tolerance = 1e-4;
  double initial_damping = 1e-3;
};

// Total cost of poses (N x F): sum of frame costs + sum_n smoothness_n (|(S (I - D^T D))_n|^2 +
// sum_k band_penalty_nk (S D^T)_nk^2); infinity outside the domain. The chart is chosen from the poses.
double BatchCost(const BatchProblem& problem, const Eigen::MatrixXd& poses);

// The same frames for another skeleton, or with other targets: as many residuals in each frame.
struct SteppedProblem {
  Skeleton skeleton;
  std::vector<FrameProblem> frames;  // F
};

// Gauss-Newton system of P parameters that poses do not contain, with the poses eliminated.
struct ReducedSystem {
  Eigen::MatrixXd hessian;   // P x P, of half the cost
  Eigen::VectorXd gradient;  // P
  double data_cost = 0;      // of the frames, without E_d
  int num_residuals = 0;     // of the frames
};

// That system at `poses` (N x F). Derivatives are difference quotients: stepped[p] is the problem
// after a step of parameter p. Dofs at their bounds do not give way. Zeros where the poses are outside
// the domain or the system is singular.
ReducedSystem ReduceBatch(const BatchProblem& problem, const Eigen::MatrixXd& poses,
                          const std::vector<SteppedProblem>& stepped, double step);

// The subspace coefficients S D^T of poses (N x F), N x K; the chart is chosen from the poses.
Eigen::MatrixXd SubspaceCoefficients(const BatchProblem& problem, const Eigen::MatrixXd& poses);

// Projected Levenberg-Marquardt from `poses` (N x F, clamped into the bounds first), which it
// improves. Cost per iteration O(F N^3 + (N K)^3) for few basis vectors, else O(F N^3) and O(F N (N +
// K)) for each round of conjugate gradients.
SolveSummary SolveBatch(const BatchProblem& problem, const BatchSolveOptions& options,
                        Eigen::MatrixXd* poses);

}  // namespace mpc
