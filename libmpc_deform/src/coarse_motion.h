// Purpose: the coarse half of the preconditioner of SurfaceStep: patches of the graph that move as
// rigid bodies. E_arap costs nothing inside a patch, so that what joins the patches makes a small
// dense problem, which carries far what the blocks of single nodes carry from ring to ring only.
// Units: unknowns in rad and m. Symbols: M nodes, P patches.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "mpc/deform/surface_solver.h"

namespace mpc {

class CoarseMotion {
 public:
  explicit CoarseMotion(const SurfaceProblem& problem);

  // The normal equations of the patches' motions at a point, damped; `at` inside the domain.
  void Linearize(const WarpField& at);
  bool ready() const { return normal_.size() > 0; }

  // product += the nodes' motion that answers x. Both 4 x 2M as in SurfaceStep.
  void Apply(const Eigen::Matrix<float, 4, Eigen::Dynamic>& x,
             Eigen::Matrix<float, 4, Eigen::Dynamic>* product);

 private:
  template <typename Energy>
  void Add(const Energy& energy, const WarpField& at, int block);

  const SurfaceProblem& problem_;
  std::vector<int> patch_;     // M
  std::vector<int> crossing_;  // edges of E_arap between patches
  int num_patches_ = 0;
  Eigen::Matrix3Xd levers_;  // 3xM, of the nodes about their patch's first
  Eigen::Matrix3Xf float_levers_;
  Eigen::MatrixXd normal_;  // 6P x 6P
  Eigen::LLT<Eigen::MatrixXf> factor_;
  Eigen::VectorXf motion_;  // 6P
};

}  // namespace mpc
