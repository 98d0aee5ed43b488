#include "mpc/deform/depth_drift_energy.h"

#include <cmath>
#include <numeric>

namespace mpc {

DepthDriftEnergy::DepthDriftEnergy(const Eigen::Matrix3Xd& nodes, double weight) {
  if (weight == 0) return;
  const double scale = kMillimetresPerMetre * std::sqrt(weight / static_cast<double>(nodes.cols()));
  scaled_rays_ = scale * nodes.colwise().normalized();
  node_index_.resize(nodes.cols());
  std::iota(node_index_.begin(), node_index_.end(), 0);
}

bool DepthDriftEnergy::Evaluate(const WarpField& at, int block, double* r,
                                BlockJacobian* jacobian) const {
  *r = scaled_rays_.col(block).dot(at.translations.col(block));
  if (jacobian != nullptr) {
    jacobian->setZero(1, 6);
    jacobian->rightCols<3>() = scaled_rays_.col(block).transpose();
  }
  return true;
}

}  // namespace mpc
