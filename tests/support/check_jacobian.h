// Purpose: the one check every analytic Jacobian of the project goes through.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>

namespace mpc::testing {

// f(x) -> value; plus(x, d) moves x by a tangent step d. Compares `jacobian` (rows x d) with central
// differences of f along every tangent direction; tolerance relative to max(1, |entry|).
inline void CheckJacobian(
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& f,
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&, const Eigen::VectorXd&)>& plus,
    const Eigen::VectorXd& x, const Eigen::MatrixXd& jacobian, double tolerance,
    double step = 1e-6) {
  const int num_tangent = static_cast<int>(jacobian.cols());
  for (int n = 0; n < num_tangent; ++n) {
    Eigen::VectorXd d = Eigen::VectorXd::Zero(num_tangent);
    d[n] = step;
    const Eigen::VectorXd ahead = f(plus(x, d));
    const Eigen::VectorXd behind = f(plus(x, -d));
    ASSERT_EQ(ahead.size(), jacobian.rows());
    const Eigen::VectorXd numeric = (ahead - behind) / (2 * step);
    for (int r = 0; r < numeric.size(); ++r) {
      const double scale = std::max(1.0, std::abs(numeric[r]));
      EXPECT_NEAR(jacobian(r, n), numeric[r], tolerance * scale) << "row " << r << " column " << n;
    }
  }
}

}  // namespace mpc::testing
