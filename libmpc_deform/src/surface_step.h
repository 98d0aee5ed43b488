// Purpose: the normal equations of E_surf at a point and their solution by conjugate gradients.
// Private to SolveSurface.
// Units: unknowns are rad and m. Symbols: M nodes. Vectors are 4 x 2M in float: columns 2i and
// 2i + 1 hold rotation and translation of node i, with a zero below, so that SIMD needs no mask.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "mpc/deform/surface_solver.h"

namespace mpc {

class SurfaceStep {
 public:
  explicit SurfaceStep(const DeformationGraph* unused) = delete;
  explicit SurfaceStep(int num_nodes);

  // Linearises. False outside the energies' domain.
  bool Linearize(const SurfaceProblem& problem, const WarpField& at);

  // The step (6 x M, rad and m) that minimises the linearised cost plus `damping` times each
  // block's own scale.
  const Eigen::Matrix<double, 6, Eigen::Dynamic>& Solve(double damping);

 private:
  using Packed = Eigen::Matrix<float, 4, Eigen::Dynamic>;
  using Block = Eigen::Matrix<double, 6, 6>;

  template <typename Energy>
  bool Add(const Energy& energy, const WarpField& at);
  void SetPreconditioner(double damping);
  void Precondition(const Packed& in, Packed* out) const;
  void Multiply(const Packed& in, Packed* out) const;

  int num_nodes_;
  Eigen::Matrix<double, 6, Eigen::Dynamic> gradient_;  // J^T r
  std::vector<Block> diagonal_;                        // of J^T J
  // E_arap: levers of the directed edges (i, j) and (j, i), times the residuals' factor.
  std::vector<int> edge_begin_, edge_end_node_;
  Packed levers_;
};

}  // namespace mpc
