#include "mpc/pose/standing_energy.h"

#include <cmath>
#include <utility>

namespace mpc {

StandingEnergy::StandingEnergy(std::vector<StandingJoint> joints, double robust_scale)
    : joints_(std::move(joints)), robust_scale_(robust_scale) {}

bool StandingEnergy::Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                              Eigen::MatrixXd* jacobian) const {
  int row = first_row;
  for (const StandingJoint& standing : joints_) {
    const double weight = std::sqrt(standing.weight);
    Eigen::Matrix<double, 1, 3> derivative = 1000 * weight * standing.ray.transpose();
    const double away_m = standing.ray.dot(at.state.joints.col(standing.joint)) - standing.range_m;
    if (standing.one_sided && away_m <= 0) {
      (*r)[row++] = 0;
      continue;
    }
    (*r)[row] = 1000 * weight * away_m;
    ApplyRobustLoss<1>(weight * robust_scale_, r->segment<1>(row),
                       jacobian != nullptr ? &derivative : nullptr);
    if (jacobian != nullptr) {
      for (const int n : at.joint_dofs[standing.joint]) {
        (*jacobian)(row, n) = derivative.dot(at.joint_jacobian.block<3, 1>(3 * standing.joint, n));
      }
    }
    ++row;
  }
  return true;
}

StandingEnergy StandingEnergy::Restricted(const std::vector<int>& joint_index) const {
  StandingEnergy restricted = *this;
  RestrictToJoints(joint_index, &restricted.joints_);
  return restricted;
}

}  // namespace mpc
