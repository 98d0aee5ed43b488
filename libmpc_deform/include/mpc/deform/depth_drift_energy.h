// Purpose: a prior against the one direction that a silhouette says nothing about: towards and away
// from the camera, where nodes would drift to change the apparent width of a limb.
// Source: ours; docs/deform.md, "Surface refinement".
// Units: residuals in pixels, as E_con. Symbols: M nodes.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mpc/deform/deformation_graph.h"
#include "mpc/deform/surface_energy.h"

namespace mpc {

// One block of one row per node: r = sqrt(w_ray / M) 1000 ray_i . t_i, ray_i the unit vector from
// the camera to g^_i.
class DepthDriftEnergy {
 public:
  // nodes: g^, 3xM in the camera frame. weight: w_ray, px^2/mm^2, not negative; 0: no blocks.
  DepthDriftEnergy(const Eigen::Matrix3Xd& nodes, double weight);

  int num_blocks() const { return static_cast<int>(scaled_rays_.cols()); }
  int rows() const { return 1; }
  std::span<const int> nodes(int block) const { return {&node_index_[block], 1}; }
  bool Evaluate(const WarpField& at, int block, double* r, BlockJacobian* jacobian) const;

 private:
  Eigen::Matrix3Xd scaled_rays_;
  std::vector<int> node_index_;
};

}  // namespace mpc
