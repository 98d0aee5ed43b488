#include <fmt/format.h>

#include "mpc/core/error.h"
#include "mpc/deform/deformation_graph.h"

namespace mpc {

WarpField WarpField::Identity(int num_nodes) {
  return {std::vector<Eigen::Matrix3d>(num_nodes, Eigen::Matrix3d::Identity()),
          Eigen::Matrix3Xd::Zero(3, num_nodes)};
}

void WarpVertices(const DeformationGraph& graph, const WarpField& field,
                  const Eigen::Matrix3Xf& posed, Eigen::Matrix3Xf* warped) {
  const int num_nodes = graph.num_nodes();
  if (posed.cols() != graph.num_vertices() ||
      static_cast<int>(field.rotations.size()) != num_nodes ||
      field.translations.cols() != num_nodes) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("warp: {} vertices, {} rotations and {} translations for a graph of {} "
                            "vertices and {} nodes",
                            posed.cols(), field.rotations.size(), field.translations.cols(),
                            graph.num_vertices(), num_nodes));
  }
  // How far W_k moves a point: (R - I) x + (t - (R - I) g^). It is zero, not just small, at the
  // identity, and exact far from the origin.
  using Affine = Eigen::Matrix<float, 4, 4>;
  std::vector<Affine, Eigen::aligned_allocator<Affine>> moves(num_nodes, Affine::Zero());
  for (int i = 0; i < num_nodes; ++i) {
    const Eigen::Matrix3d turn = field.rotations[i] - Eigen::Matrix3d::Identity();
    const Eigen::Vector3d node = posed.col(graph.node_vertices[i]).cast<double>();
    moves[i].topLeftCorner<3, 3>() = turn.cast<float>();
    moves[i].topRightCorner<3, 1>() = (field.translations.col(i) - turn * node).cast<float>();
  }
  warped->resize(3, posed.cols());
  for (int v = 0; v < graph.num_vertices(); ++v) {
    Affine move = Affine::Zero();
    for (Eigen::Index k = 0; k < graph.weights.rows() && graph.weights(k, v) > 0; ++k) {
      move += graph.weights(k, v) * moves[graph.influences(k, v)];
    }
    const Eigen::Vector4f x(posed(0, v), posed(1, v), posed(2, v), 1);
    warped->col(v) = posed.col(v) + (move * x).head<3>();
  }
}

}  // namespace mpc
