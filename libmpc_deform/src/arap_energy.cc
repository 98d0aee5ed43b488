#include "mpc/deform/arap_energy.h"

#include <cmath>

namespace mpc {

ArapEnergy::ArapEnergy(const DeformationGraph& graph, const Eigen::Matrix3Xd& nodes, double weight)
    : scale_(kMillimetresPerMetre * std::sqrt(weight / graph.num_nodes())) {
  for (int i = 0; i < graph.num_nodes(); ++i) {
    for (int e = graph.neighbor_begin[i]; e < graph.neighbor_begin[i + 1]; ++e) {
      const int j = graph.neighbors[e];
      edges_.push_back({i, j});
      levers_.emplace_back(nodes.col(i) - nodes.col(j));
    }
  }
}

bool ArapEnergy::Evaluate(const WarpField& at, int block, double* r,
                          BlockJacobian* jacobian) const {
  const auto [i, j] = edges_[block];
  const Eigen::Vector3d turned = at.rotations[i] * levers_[block];
  const Eigen::Vector3d stretch =
      levers_[block] + at.translations.col(i) - at.translations.col(j) - turned;
  Eigen::Vector3d::Map(r) = scale_ * stretch;
  if (jacobian == nullptr) return true;
  jacobian->setZero(3, 12);
  // -d (exp(omega) turned) = turned x omega.
  const Eigen::Vector3d y = scale_ * turned;
  jacobian->block<3, 3>(0, 0) << 0, -y.z(), y.y(), y.z(), 0, -y.x(), -y.y(), y.x(), 0;
  jacobian->block<3, 3>(0, 3).diagonal().setConstant(scale_);
  jacobian->block<3, 3>(0, 9).diagonal().setConstant(-scale_);
  return true;
}

}  // namespace mpc
