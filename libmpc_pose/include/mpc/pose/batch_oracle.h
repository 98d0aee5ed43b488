// Purpose: the batch pose problem solved by Ceres: the oracle that the product solver of
// batch_solver.h is checked against and measured beside.
// Source: paper, Section 4, Eq. (opt). Same cost, same chart of the root, same bounds. The
// coefficients C are variables of their own (E_d = min over C of |Lambda (S - C D)|^2), so that
// the frames can be eliminated block by block.
// Units: as the energies'. Symbols: N dofs, F frames, K basis vectors.
#pragma once

#include <Eigen/Core>

#include "mpc/pose/batch_solver.h"
#include "mpc/pose/summary.h"

namespace mpc {

struct BatchOracleOptions {
  int max_iterations = 200;
  double relative_tolerance = 1e-7;  // stop when a step lowers the cost by less
};

// As SolveBatch: improves `poses` (N x F, clamped into the bounds first). The costs of the summary
// are the problem's with C at its best, in the start's chart, and so comparable with SolveBatch's.
// Single-threaded; about ten times slower than SolveBatch.
SolveSummary SolveBatchCeres(const BatchProblem& problem, const BatchOracleOptions& options,
                             Eigen::MatrixXd* poses);

}  // namespace mpc
