// Purpose: a prior against motions that a silhouette says nothing about. Towards and away from the
// camera nodes would drift to change the apparent width of a limb; across the view pieces of cloth
// would slide and turn at no cost in E_arap to please noise at one place of the outline.
// Source: ours; docs/deform.md, "Surface refinement".
// Units: residuals in pixels, as E_con. Symbols: M nodes.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mpc/deform/deformation_graph.h"
#include "mpc/deform/surface_energy.h"

namespace mpc {

// One block of three rows per node, with P = ray_i ray_i^T, ray_i the unit vector from the camera
// to g^_i: r = 1000 / sqrt(M) (sqrt(w_ray) P t_i + sqrt(w_side) (I - P) (t_i - start_i)).
class DriftEnergy {
 public:
  // nodes: g^, start: translations at the iteration's start, both 3xM in the camera frame. Weights:
  // w_ray and w_side, px^2/mm^2, not negative; both 0: no blocks.
  DriftEnergy(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix3Xd& start, double ray_weight,
              double side_weight);

  int num_blocks() const { return static_cast<int>(node_index_.size()); }
  int rows() const { return 3; }
  std::span<const int> nodes(int block) const { return {&node_index_[block], 1}; }
  bool Evaluate(const WarpField& at, int block, double* r, BlockJacobian* jacobian) const;

 private:
  std::vector<Eigen::Matrix3d> by_translation_;
  Eigen::Matrix3Xd at_rest_;  // by_translation_ t_i where r = 0
  std::vector<int> node_index_;
};

}  // namespace mpc
