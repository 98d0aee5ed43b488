#include "mpc/deform/stability_energy.h"

#include <cmath>

#include "mpc/core/joints.h"

namespace mpc {

StabilityEnergy::StabilityEnergy(const Skeleton& skeleton, const Eigen::VectorXd& batch_pose,
                                 double weight, double free_depth) {
  KinematicState state;
  ForwardKinematics(skeleton, batch_pose, &state);
  reference_ = state.joints;
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    if (static_cast<int>(skeleton.joints[static_cast<size_t>(j)].id) < kNumPaperJoints) {
      joints_.push_back(j);
    }
  }
  const Eigen::Vector3d ray = reference_(Eigen::all, joints_).rowwise().mean().normalized();
  free_ = free_depth * ray * ray.transpose();
  scale_ = 1000 * std::sqrt(weight / static_cast<double>(joints_.size()));
}

bool StabilityEnergy::Evaluate(const RefinementPoint& at, int first_row, Eigen::VectorXd* r,
                               Eigen::MatrixXd* jacobian) const {
  const double share = 1 / static_cast<double>(joints_.size());
  Eigen::Vector3d common = Eigen::Vector3d::Zero();
  Eigen::Matrix3Xd common_jacobian;
  if (jacobian != nullptr) common_jacobian.setZero(3, jacobian->rows());
  for (const int j : joints_) {
    common += share * free_ * (at.state.joints.col(j) - reference_.col(j));
    if (jacobian == nullptr) continue;
    common_jacobian += share * free_ * at.joint_jacobian.middleRows<3>(3 * j);
  }
  for (size_t i = 0; i < joints_.size(); ++i) {
    const int j = joints_[i];
    const int row = first_row + 3 * static_cast<int>(i);
    r->segment<3>(row) = scale_ * (at.state.joints.col(j) - reference_.col(j) - common);  // Eq. 12
    if (jacobian == nullptr) continue;
    jacobian->middleCols<3>(row) =
        scale_ * (at.joint_jacobian.middleRows<3>(3 * j) - common_jacobian).transpose();
  }
  return true;
}

}  // namespace mpc
