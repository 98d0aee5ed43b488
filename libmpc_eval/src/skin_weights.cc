#include "skin_weights.h"

#include <algorithm>
#include <numeric>

namespace mpc {

SkinWeights DiffuseWeights(const TriangleMesh& mesh, const std::vector<int>& parts, int num_parts) {
  constexpr int kRounds = 14;
  constexpr float kLeast = 0.01F;
  const Eigen::Index num_vertices = mesh.positions.cols();
  Eigen::MatrixXf dense = Eigen::MatrixXf::Zero(num_parts, num_vertices);
  for (Eigen::Index v = 0; v < num_vertices; ++v) dense(parts[v], v) = 1;
  const std::vector<MeshEdge> edges = MeshEdges(mesh.triangles);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::MatrixXf sum = dense;
    Eigen::RowVectorXf count = Eigen::RowVectorXf::Ones(num_vertices);
    for (const MeshEdge& edge : edges) {
      sum.col(edge.v0) += dense.col(edge.v1);
      sum.col(edge.v1) += dense.col(edge.v0);
      count[edge.v0] += 1;
      count[edge.v1] += 1;
    }
    dense = sum.array().rowwise() / count.array();
  }
  SkinWeights skin;
  skin.indices.setZero(SkinWeights::kInfluences, num_vertices);
  skin.weights.setZero(SkinWeights::kInfluences, num_vertices);
  std::vector<int> order(static_cast<size_t>(num_parts));
  for (Eigen::Index v = 0; v < num_vertices; ++v) {
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return dense(a, v) > dense(b, v); });
    for (int k = 0; k < SkinWeights::kInfluences; ++k) {
      const float weight = dense(order[k], v);
      if (weight < kLeast) break;
      skin.indices(k, v) = order[k];
      skin.weights(k, v) = weight;
    }
    skin.weights.col(v) /= skin.weights.col(v).sum();
  }
  return skin;
}

void SkinWeights::Append(const Eigen::MatrixXi& more_indices, const Eigen::MatrixXf& more_weights) {
  const Eigen::Index before = weights.cols();
  const Eigen::Index more = more_weights.cols();
  indices.conservativeResize(kInfluences, before + more);
  weights.conservativeResize(kInfluences, before + more);
  indices.rightCols(more).setZero();
  weights.rightCols(more).setZero();
  indices.topRightCorner(more_indices.rows(), more) = more_indices;
  weights.topRightCorner(more_weights.rows(), more) = more_weights;
}

}  // namespace mpc
