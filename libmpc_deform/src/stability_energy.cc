#include "mpc/deform/stability_energy.h"

#include <cmath>

#include "mpc/core/joints.h"

namespace mpc {

StabilityEnergy::StabilityEnergy(const Skeleton& skeleton, const Eigen::VectorXd& batch_pose,
                                 double weight) {
  KinematicState state;
  ForwardKinematics(skeleton, batch_pose, &state);
  reference_ = state.joints;
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    if (static_cast<int>(skeleton.joints[static_cast<size_t>(j)].id) < kNumPaperJoints) {
      joints_.push_back(j);
    }
  }
  scale_ = 1000 * std::sqrt(weight / static_cast<double>(joints_.size()));
}

bool StabilityEnergy::Evaluate(const RefinementPoint& at, int first_row, Eigen::VectorXd* r,
                               Eigen::MatrixXd* jacobian) const {
  for (size_t i = 0; i < joints_.size(); ++i) {
    const int j = joints_[i];
    const int row = first_row + 3 * static_cast<int>(i);
    r->segment<3>(row) = scale_ * (at.state.joints.col(j) - reference_.col(j));  // Eq. 12
    if (jacobian == nullptr) continue;
    jacobian->middleCols<3>(row) = scale_ * at.joint_jacobian.middleRows<3>(3 * j).transpose();
  }
  return true;
}

}  // namespace mpc
