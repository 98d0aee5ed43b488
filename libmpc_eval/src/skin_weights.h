// Purpose: smooth skin weights of a closed body from the part each vertex lies on.
// Source: ours. Symbols: V vertices, K influences.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

struct SkinWeights {
  static constexpr int kInfluences = 4;
  Eigen::MatrixXi indices;  // KxV, 0 where the weight is 0
  Eigen::MatrixXf weights;  // KxV, columns sum to one

  // More vertices, of up to K influences.
  void Append(const Eigen::MatrixXi& more_indices, const Eigen::MatrixXf& more_weights);
};

// Each vertex starts on its part; then weights diffuse along the surface, so that they never leak
// from one leg or arm to another through the air.
SkinWeights DiffuseWeights(const TriangleMesh& mesh, const std::vector<int>& parts, int num_parts);

}  // namespace mpc
