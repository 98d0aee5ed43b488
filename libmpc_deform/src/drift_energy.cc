#include "mpc/deform/drift_energy.h"

#include <cmath>
#include <numeric>

namespace mpc {

DriftEnergy::DriftEnergy(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix3Xd& start,
                         double ray_weight, double side_weight) {
  if (ray_weight == 0 && side_weight == 0) return;
  const auto num_nodes = static_cast<double>(nodes.cols());
  const double along = kMillimetresPerMetre * std::sqrt(ray_weight / num_nodes);
  const double across = kMillimetresPerMetre * std::sqrt(side_weight / num_nodes);
  at_rest_.resize(3, nodes.cols());
  for (int i = 0; i < nodes.cols(); ++i) {
    const Eigen::Vector3d ray = nodes.col(i).normalized();
    const Eigen::Matrix3d onto_ray = ray * ray.transpose();
    const Eigen::Matrix3d to_side = across * (Eigen::Matrix3d::Identity() - onto_ray);
    by_translation_.push_back(along * onto_ray + to_side);
    at_rest_.col(i) = to_side * start.col(i);
  }
  node_index_.resize(nodes.cols());
  std::iota(node_index_.begin(), node_index_.end(), 0);
}

bool DriftEnergy::Evaluate(const WarpField& at, int block, double* r,
                           BlockJacobian* jacobian) const {
  const Eigen::Matrix3d& by_translation = by_translation_[block];
  Eigen::Vector3d::Map(r) = by_translation * at.translations.col(block) - at_rest_.col(block);
  if (jacobian != nullptr) {
    jacobian->setZero(3, 6);
    jacobian->rightCols<3>() = by_translation;
  }
  return true;
}

}  // namespace mpc
