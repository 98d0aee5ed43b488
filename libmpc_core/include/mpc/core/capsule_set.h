// Purpose: a skeleton as solid limbs: line segments with a radius at each end.
// Units: metres.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace mpc {

struct Capsule {
  Eigen::Vector3d a = Eigen::Vector3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double radius_a = 0;
  double radius_b = 0;
};

using CapsuleSet = std::vector<Capsule>;

}  // namespace mpc
