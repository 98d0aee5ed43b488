// Purpose: a smooth lower envelope, so that what touches the floor changes without a jerk.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace mpc {

// -t log(sum exp(-x / t)) + t log(n): the minimum of x as t -> 0, at most t log(n) above it.
inline double SoftMin(const Eigen::VectorXd& x, double temperature) {
  const double least = x.minCoeff();
  const double mean = ((least - x.array()) / temperature).exp().mean();
  return least - temperature * std::log(mean);
}

}  // namespace mpc
