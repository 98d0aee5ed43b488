#include "mpc/pose/rest_prior_energy.h"

#include <utility>

namespace mpc {

RestPriorEnergy::RestPriorEnergy(Eigen::VectorXd rest_rad, Eigen::VectorXd weights)
    : rest_rad_(std::move(rest_rad)), sqrt_weights_(weights.cwiseSqrt()) {}

bool RestPriorEnergy::Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                               Eigen::MatrixXd* jacobian) const {
  const int num_hinges = num_residuals();
  r->segment(first_row, num_hinges) =
      sqrt_weights_.cwiseProduct(at.pose.tail(num_hinges) - rest_rad_);
  if (jacobian != nullptr) {
    jacobian->block(first_row, 6, num_hinges, num_hinges).diagonal() = sqrt_weights_;
  }
  return true;
}

RestPriorEnergy RestPriorEnergy::Restricted(const std::vector<int>& hinges) const {
  RestPriorEnergy restricted;
  if (num_residuals() == 0) return restricted;
  restricted.rest_rad_ = rest_rad_(hinges);
  restricted.sqrt_weights_ = sqrt_weights_(hinges);
  return restricted;
}

}  // namespace mpc
