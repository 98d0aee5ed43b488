#include "mpc/pose/reprojection_energy.h"

#include <cmath>
#include <utility>

namespace mpc {

ReprojectionEnergy::ReprojectionEnergy(const Camera& camera,
                                       std::vector<Observation2d> observations, double unit_per_px,
                                       double robust_scale)
    : camera_(camera),
      observations_(std::move(observations)),
      unit_per_px_(unit_per_px),
      robust_scale_(robust_scale) {}

bool ReprojectionEnergy::Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                                  Eigen::MatrixXd* jacobian) const {
  int row = first_row;
  for (const Observation2d& observation : observations_) {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> projection = Eigen::Matrix<double, 2, 3>::Zero();
    if (!Project(camera_, at.state.joints.col(observation.joint), &pixel,
                 jacobian != nullptr ? &projection : nullptr)) {
      return false;
    }
    const double weight = std::sqrt(observation.weight);
    const double scale = weight * unit_per_px_;
    r->segment<2>(row) = scale * (pixel - observation.pixel);  // E_2d
    projection *= scale;
    ApplyRobustLoss<2>(weight * robust_scale_, r->segment<2>(row),
                       jacobian != nullptr ? &projection : nullptr);
    if (jacobian != nullptr) {
      for (const int n : at.joint_dofs[observation.joint]) {
        jacobian->block<2, 1>(row, n).noalias() =
            projection * at.joint_jacobian.block<3, 1>(3 * observation.joint, n);
      }
    }
    row += 2;
  }
  return true;
}

ReprojectionEnergy ReprojectionEnergy::Restricted(const std::vector<int>& joint_index) const {
  ReprojectionEnergy restricted = *this;
  RestrictToJoints(joint_index, &restricted.observations_);
  return restricted;
}

}  // namespace mpc
