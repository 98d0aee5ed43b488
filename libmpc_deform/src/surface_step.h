// Purpose: the normal equations of E_surf at a point and their solution by conjugate gradients; the
// inside of SolveSurface.
// Units: unknowns in rad and m. Symbols: M nodes.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "coarse_motion.h"
#include "mpc/deform/surface_solver.h"

namespace mpc {

class SurfaceStep {
 public:
  explicit SurfaceStep(const SurfaceProblem& problem);

  // Gradient J^T r and the parts of J^T J at a point. False outside the energies' domain.
  bool Linearize(const WarpField& at);

  // Where the linearised cost plus `damping` times each block's own scale is least, to the
  // accuracy of some conjugate gradients.
  WarpField Step(const WarpField& from, double damping);

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Block = Eigen::Matrix<double, 6, 6>;
  // Columns of floats that end in a zero, so that SIMD takes them as they are. A vector of unknowns
  // has two columns per node: rotation, translation.
  using Packed = Eigen::Matrix<float, 4, Eigen::Dynamic>;

  void AddArap(const WarpField& at);
  bool AddContour(const WarpField& at);
  void AddDepthDrift(const WarpField& at);
  void Damp(double damping);
  void Multiply(const Packed& x, Packed* product) const;
  void Precondition(const Packed& x, Packed* product);
  void SolveInner();

  const SurfaceProblem& problem_;
  CoarseMotion coarse_;
  std::vector<int> edge_begin_;                        // M+1: directed edges (i, j) by i
  std::vector<int> edge_node_;                         // j
  std::vector<int> row_begin_;                         // of E_con
  Eigen::Matrix<double, 6, Eigen::Dynamic> gradient_;  // 6xM
  // The 6x6 blocks on the diagonal of J^T J: all of it, and without E_con, which Multiply applies
  // row by row.
  std::vector<Block> diagonal_, smooth_diagonal_;

  Packed edge_levers_;  // 2 columns per edge: scale^2 R_i (g^_i - g^_j) and the same of (j, i)
  Packed row_blocks_;   // 2 columns per node of a row
  Packed own_blocks_;   // 7 columns per node: rotation 3, translation 3, sum of its levers
  Packed inverses_;     // 12 columns per node: of diagonal_, damped
  Packed step_, residual_, direction_, product_, preconditioned_;
};

}  // namespace mpc
