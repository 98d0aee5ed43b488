// Purpose: E_arap: neighbouring nodes move as rigidly as possible.
// Source: paper, Section 5.3, Eq. 18; Sorkine and Alexa 2007:
//   E_arap(D) = 1/M sum_i sum_{j in N_i} |(g_i - g_j) - R_i (g^_i - g^_j)|^2, g_i = g^_i + t_i.
// Units: millimetres. Symbols: M nodes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "mpc/deform/deformation_graph.h"
#include "mpc/deform/surface_energy.h"

namespace mpc {

// One block of three rows per directed edge (i, j), in the order of DeformationGraph::neighbors:
//   r = sqrt(w_arap / M) 1000 ((g_i - g_j) - R_i (g^_i - g^_j)).
class ArapEnergy {
 public:
  // nodes: g^, 3xM. weight: w_arap, not negative.
  ArapEnergy(const DeformationGraph& graph, const Eigen::Matrix3Xd& nodes, double weight);

  int num_blocks() const { return static_cast<int>(edges_.size()); }
  int rows() const { return 3; }
  std::span<const int> nodes(int block) const { return edges_[block]; }
  bool Evaluate(const WarpField& at, int block, double* r, BlockJacobian* jacobian) const;

  // g^_i - g^_j, m, and the factor 1000 sqrt(w_arap / M) of all residuals.
  const Eigen::Vector3d& rest(int block) const { return levers_[block]; }
  double scale() const { return scale_; }

 private:
  std::vector<std::array<int, 2>> edges_;
  std::vector<Eigen::Vector3d> levers_;  // g^_i - g^_j
  double scale_;
};

}  // namespace mpc
