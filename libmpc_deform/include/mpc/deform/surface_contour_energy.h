// Purpose: E_con of the surface: outline vertices on the silhouette.
// Source: paper, Section 5.3, Eq. 17: E_con(D) = 1/|S| sum_k [n_k . (Pi(v_k(D)) - s_k)]^2.
// Units: pixels of a picture whose longer side has 1920. Symbols: K influences per vertex.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/deform/correspondences.h"
#include "mpc/deform/deformation_graph.h"
#include "mpc/deform/surface_energy.h"

namespace mpc {

// One block of one row per correspondence, in their order:
//   r = sqrt(weight / |S|) 1920 / longer side * n . (Pi(v(D)) - s).
class SurfaceContourEnergy {
 public:
  // posed: v^, 3xV in the camera frame. Throws Error (kInvalidArgument) for sizes and vertices that
  // do not fit.
  SurfaceContourEnergy(const Camera& camera, const DeformationGraph& graph,
                       const Eigen::Matrix3Xf& posed, const Correspondences& correspondences);

  int num_blocks() const { return static_cast<int>(pairs_.size()); }
  int rows() const { return 1; }
  std::span<const int> nodes(int block) const;

  // False when the vertex has left the camera's view.
  bool Evaluate(const WarpField& at, int block, double* r, BlockJacobian* jacobian) const;

 private:
  struct Pair {
    Eigen::Vector3d posed;
    Eigen::Vector2d target, scaled_normal;
    int begin;  // of its influences
    int count;
  };
  Camera camera_;
  std::vector<Pair> pairs_;
  std::vector<int> nodes_;
  std::vector<double> shares_;           // b
  std::vector<Eigen::Vector3d> levers_;  // v^ - g^
};

}  // namespace mpc
