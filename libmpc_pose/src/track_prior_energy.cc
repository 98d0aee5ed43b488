#include "mpc/pose/track_prior_energy.h"

#include <cmath>

#include "mpc/core/rigid.h"

namespace mpc {
namespace {

// d log(exp(w) R R_0^T) / d w at w = 0, with v = log(R R_0^T): the inverse left Jacobian.
Eigen::Matrix3d InverseLeftJacobian(const Eigen::Vector3d& v) {
  const double angle = v.norm();
  const Eigen::Matrix3d cross = CrossMatrix(v);
  const double c =
      angle < 1e-4 ? 1.0 / 12 : (1 - angle / 2 / std::tan(angle / 2)) / (angle * angle);
  return Eigen::Matrix3d::Identity() - 0.5 * cross + c * cross * cross;
}

}  // namespace

TrackPriorEnergy::TrackPriorEnergy(const Eigen::VectorXd& pose, double translation_weight,
                                   double angle_weight)
    : pose_(pose),
      rotation_(ExpSO3(pose.segment<3>(3))),
      translation_scale_(std::sqrt(translation_weight)),
      angle_scale_(std::sqrt(angle_weight)) {}

bool TrackPriorEnergy::Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                                Eigen::MatrixXd* jacobian) const {
  const int num_dofs = num_residuals();
  if (num_dofs == 0) return true;
  const int num_hinges = num_dofs - 6;
  const Eigen::Vector3d turn = LogSO3(at.root_rotation * rotation_.transpose());
  r->segment<3>(first_row) = translation_scale_ * (at.pose - pose_).head<3>();
  r->segment<3>(first_row + 3) = angle_scale_ * turn;
  r->segment(first_row + 6, num_hinges) = angle_scale_ * (at.pose - pose_).tail(num_hinges);
  if (jacobian != nullptr) {
    jacobian->block<3, 3>(first_row, 0).diagonal().setConstant(translation_scale_);
    jacobian->block<3, 3>(first_row + 3, 3) = angle_scale_ * InverseLeftJacobian(turn);
    jacobian->block(first_row + 6, 6, num_hinges, num_hinges).diagonal().setConstant(angle_scale_);
  }
  return true;
}

}  // namespace mpc
