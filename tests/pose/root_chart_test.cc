#include "mpc/pose/root_chart.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "mpc/core/rigid.h"
#include "support/check_jacobian.h"

namespace mpc {
namespace {

constexpr double kPi = std::numbers::pi;

// Turns about a tilted axis with a wobble across it.
std::vector<Eigen::Matrix3d> Turning(double angle_rad, int num_frames) {
  const Eigen::Vector3d axis = Eigen::Vector3d(0.2, 1, -0.1).normalized();
  std::vector<Eigen::Matrix3d> rotations;
  for (int f = 0; f < num_frames; ++f) {
    const double t = static_cast<double>(f) / num_frames;
    const Eigen::Vector3d wobble(0.3 * std::sin(5 * t), 0, 0.2 * std::cos(7 * t));
    rotations.push_back(ExpSO3(angle_rad * t * axis) * ExpSO3(wobble) *
                        ExpSO3({kPi - 0.1, 0.2, 0}));
  }
  return rotations;
}

TEST(RootChartTest, RoundTripOverTwoTurns) {
  for (const double turn : {0.0, 0.5, 2 * kPi, 4 * kPi, -4 * kPi}) {
    const std::vector<Eigen::Matrix3d> rotations = Turning(turn, 50);
    const RootChart chart(rotations);
    const Eigen::Matrix3Xd coordinates = chart.Coordinates(rotations);
    for (int f = 0; f < 50; ++f) {
      EXPECT_LT((chart.Rotation(coordinates.col(f)) - rotations[f]).norm(), 1e-12) << f;
      if (f == 0) continue;
      // No jump where a rotation vector wraps: steps as small as the motion's.
      const double step = (coordinates.col(f) - coordinates.col(f - 1)).norm();
      EXPECT_LT(step, 0.12 + 1.2 * std::abs(turn) / 50) << f;
    }
    if (std::abs(turn) > 6) {
      EXPECT_NEAR(std::abs(coordinates(0, 49) - coordinates(0, 0)), std::abs(turn) * 49 / 50, 0.5);
    }
  }
}

TEST(RootChartTest, OneRotationIsTheOrigin) {
  const std::vector<Eigen::Matrix3d> rotations = {ExpSO3({1, 2, 0.5})};
  const RootChart chart(rotations);
  EXPECT_LT(chart.Coordinates(rotations).norm(), 1e-12);
  EXPECT_LT((chart.Rotation(Eigen::Vector3d::Zero()) - rotations[0]).norm(), 1e-12);
}

TEST(RootChartTest, JacobianIsTheDerivative) {
  const RootChart chart(Turning(4 * kPi, 50));
  std::mt19937 rng(2);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20; ++i) {
    // The first at the origin, where exp is singular in its usual form.
    const double size = i == 0 ? 0 : 1;
    const Eigen::VectorXd x =
        size * Eigen::Vector3d(5 * normal(rng), 0.5 * normal(rng), 0.5 * normal(rng));
    const Eigen::Matrix3d at = chart.Rotation(x);
    testing::CheckJacobian(
        [&](const Eigen::VectorXd& y) -> Eigen::VectorXd {
          return LogSO3(chart.Rotation(y) * at.transpose());
        },
        [](const Eigen::VectorXd& y, const Eigen::VectorXd& d) -> Eigen::VectorXd { return y + d; },
        x, chart.Jacobian(x), 1e-7);
  }
}

}  // namespace
}  // namespace mpc
