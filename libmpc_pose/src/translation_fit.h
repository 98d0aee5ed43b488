// Purpose: where a rigid set of points must be to project onto image points.
// Units: metres, normalised image coordinates.
#pragma once

#include <Eigen/Core>

namespace mpc {

// Linear least squares for t in (x + t)_xy = m (x + t)_z, one pair at a time.
class TranslationFit {
 public:
  void Add(const Eigen::Vector3d& x, const Eigen::Vector2d& m, double weight);
  // Not finite when the pairs do not determine it.
  Eigen::Vector3d Solve() const;

 private:
  Eigen::Matrix3d a_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b_ = Eigen::Vector3d::Zero();
};

}  // namespace mpc
