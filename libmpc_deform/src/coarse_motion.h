// Purpose: the coarse half of the preconditioner of SurfaceStep: patches of the graph that move as
// rigid bodies. E_arap costs nothing inside a patch, so that what joins the patches makes a small
// dense problem, which carries far what the blocks of single nodes carry from ring to ring only.
// Units: unknowns in rad and m. Symbols: M nodes, P patches.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <span>
#include <vector>

#include "mpc/deform/surface_solver.h"
#include "packed.h"

namespace mpc {

class CoarseMotion {
 public:
  // E_arap's edges (i, j) by i, in its order: edge_begin of M+1, and j.
  CoarseMotion(const SurfaceProblem& problem, std::span<const int> edge_begin,
               std::span<const int> edge_node);

  // The normal equations of the patches' motions at a point, damped; `at` inside the domain.
  void Linearize(const WarpField& at);

  // product += the nodes' motion that answers x.
  void Apply(const Packed& x, Packed* product);

 private:
  template <typename Energy>
  void AddBlock(const Energy& energy, const WarpField& at, int block);
  void Add(int a, int b, const Eigen::Matrix<double, 6, 6>& block);

  const SurfaceProblem& problem_;
  std::vector<int> patch_;     // M
  std::vector<int> crossing_;  // edges of E_arap between patches
  int num_patches_ = 0;
  Eigen::Matrix3Xd levers_;  // 3xM, of the nodes about their patch's first
  Packed packed_levers_;     // 4xM
  Eigen::MatrixXd normal_;   // 6P x 6P, its lower half
  Eigen::LLT<Eigen::MatrixXf> factor_;
  Packed motion_;           // 4x2P
  Eigen::VectorXf answer_;  // 6P
};

}  // namespace mpc
