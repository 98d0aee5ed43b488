#include "mpc/pose/rest_prior_energy.h"

#include <utility>

namespace mpc {

RestPriorEnergy::RestPriorEnergy(Eigen::VectorXd rest_rad, const Eigen::VectorXd& weights,
                                 const Eigen::VectorXd& widths_rad)
    : rest_rad_(std::move(rest_rad)),
      sqrt_weights_(weights.cwiseSqrt()),
      inverse_widths_(Eigen::VectorXd::Zero(rest_rad_.size())) {
  if (widths_rad.size() > 0) inverse_widths_ = widths_rad.cwiseInverse();
}

bool RestPriorEnergy::Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                               Eigen::MatrixXd* jacobian) const {
  const int num_hinges = num_residuals();
  const Eigen::ArrayXd off = at.pose.tail(num_hinges) - rest_rad_;
  const Eigen::ArrayXd q = 1 / (1 + (off * inverse_widths_.array()).square());
  r->segment(first_row, num_hinges) = sqrt_weights_.array() * off * q.sqrt();
  if (jacobian != nullptr) {
    jacobian->block(first_row, 6, num_hinges, num_hinges).diagonal() =
        sqrt_weights_.array() * q * q.sqrt();
  }
  return true;
}

RestPriorEnergy RestPriorEnergy::Restricted(const std::vector<int>& hinges) const {
  RestPriorEnergy restricted;
  if (num_residuals() == 0) return restricted;
  restricted.rest_rad_ = rest_rad_(hinges);
  restricted.sqrt_weights_ = sqrt_weights_(hinges);
  restricted.inverse_widths_ = inverse_widths_(hinges);
  return restricted;
}

}  // namespace mpc
