#include "mpc/pose/bone_vector_energy.h"

#include <cmath>
#include <utility>

namespace mpc {

BoneVectorEnergy::BoneVectorEnergy(std::vector<BoneObservation> bones,
                                   const Eigen::Matrix3d& body_from_ray,
                                   const BoneVectorWeights& weights)
    : bones_(std::move(bones)), robust_scale_(weights.robust_scale) {
  const Eigen::Vector3d axes(weights.across, weights.across, weights.along);
  metric_ = 1000 * axes.asDiagonal() * body_from_ray.transpose();
}

bool BoneVectorEnergy::Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                                Eigen::MatrixXd* jacobian) const {
  int row = first_row;
  for (const BoneObservation& bone : bones_) {
    const double weight = std::sqrt(bone.weight);
    Eigen::Matrix3d metric = weight * metric_;
    r->segment<3>(row) =
        metric * (at.state.joints.col(bone.b) - at.state.joints.col(bone.a) - bone.vector);
    ApplyRobustLoss<3>(weight * robust_scale_, r->segment<3>(row),
                       jacobian != nullptr ? &metric : nullptr);
    if (jacobian != nullptr) {
      for (const int n : at.joint_dofs[bone.b]) {
        jacobian->block<3, 1>(row, n).noalias() =
            metric * at.joint_jacobian.block<3, 1>(3 * bone.b, n);
      }
      for (const int n : at.joint_dofs[bone.a]) {
        jacobian->block<3, 1>(row, n).noalias() -=
            metric * at.joint_jacobian.block<3, 1>(3 * bone.a, n);
      }
    }
    row += 3;
  }
  return true;
}

BoneVectorEnergy BoneVectorEnergy::Restricted(const std::vector<int>& joint_index) const {
  BoneVectorEnergy restricted = *this;
  std::erase_if(restricted.bones_, [&](const BoneObservation& bone) {
    return joint_index[bone.a] < 0 || joint_index[bone.b] < 0;
  });
  for (BoneObservation& bone : restricted.bones_) {
    bone.a = joint_index[bone.a];
    bone.b = joint_index[bone.b];
  }
  return restricted;
}

}  // namespace mpc
