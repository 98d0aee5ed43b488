// Purpose: the normal equations of E_surf at a point and their solution by conjugate gradients; the
// inside of SolveSurface.
// Units: unknowns in rad and m. Symbols: M nodes.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "coarse_motion.h"
#include "mpc/deform/surface_solver.h"
#include "packed.h"
#include "surface_kernel.h"

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

  void AddArap(const WarpField& at);
  bool AddContour(const WarpField& at, bool to_diagonal);
  Block SmoothBlock(int node) const;
  void AddDrift(const WarpField& at);
  void Damp(double damping);
  void Multiply(const Packed& x, Packed* product) const;
  void Precondition(const Packed& x, Packed* product);
  void SolveInner();

  const SurfaceProblem& problem_;
  SurfaceKernel kernel_ = BestSurfaceKernel();
  std::optional<CoarseMotion> coarse_;
  std::vector<int> edge_begin_;                        // M+1: directed edges (i, j) by i
  std::vector<int> edge_node_;                         // j
  std::vector<int> edge_back_;                         // the edge (j, i)
  std::vector<int> row_begin_, row_node_;              // of E_con
  Eigen::Matrix4Xd rest_, turns_, shifts_;             // what ArapPoint refers to
  Eigen::Matrix<double, 8, Eigen::Dynamic> gradient_;  // 8xM: rotation, 0, translation, 0
  std::vector<Block> diagonal_;  // the 6x6 blocks on the diagonal of J^T J at the first point

  // What NormalEquations refers to; smooth_: own_blocks_ before damping, without E_con, which
  // Multiply applies row by row; inverses_: of diagonal_, damped.
  Packed edge_levers_, row_blocks_, smooth_, own_blocks_, inverses_;
  double inverses_damping_ = 0;
  Packed step_, residual_, direction_, product_, preconditioned_;
};

}  // namespace mpc
