#include "mpc/pose/joint_position_energy.h"

#include <cmath>
#include <utility>

namespace mpc {

JointPositionEnergy::JointPositionEnergy(std::vector<int> joints, Eigen::Matrix3Xd positions,
                                         double weight)
    : joints_(std::move(joints)), positions_(std::move(positions)), weight_(weight) {}

bool JointPositionEnergy::Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                                   Eigen::MatrixXd* jacobian) const {
  const int num_joints = static_cast<int>(joints_.size());
  if (num_joints == 0) return true;
  const double scale = 1000 * std::sqrt(weight_);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int i = 0; i < num_joints; ++i) {
    mean += (at.state.joints.col(joints_[i]) - positions_.col(i)) / num_joints;
  }
  for (int i = 0; i < num_joints; ++i) {
    r->segment<3>(first_row + 3 * i) =
        scale * (at.state.joints.col(joints_[i]) - positions_.col(i) - mean);  // E_3d
  }
  if (jacobian != nullptr) {
    Eigen::Matrix3Xd mean_jacobian = Eigen::Matrix3Xd::Zero(3, jacobian->cols());
    for (const int joint : joints_) {
      mean_jacobian += at.joint_jacobian.middleRows<3>(3 * joint) / num_joints;
    }
    for (int i = 0; i < num_joints; ++i) {
      jacobian->middleRows<3>(first_row + 3 * i) =
          scale * (at.joint_jacobian.middleRows<3>(3 * joints_[i]) - mean_jacobian);
    }
  }
  return true;
}

}  // namespace mpc
