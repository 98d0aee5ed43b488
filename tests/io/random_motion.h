// Purpose: smooth random motion within the joint limits, with two full turns of the root.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <random>

#include "mpc/core/rigid.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc::testing {

// N x F.
inline Eigen::MatrixXd RandomMotion(const Skeleton& skeleton, int num_frames, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const Eigen::VectorXd lower = skeleton.LowerBounds();
  const Eigen::VectorXd upper = skeleton.UpperBounds();
  Eigen::MatrixXd poses(skeleton.num_dofs(), num_frames);
  for (int n = 0; n < poses.rows(); ++n) {
    const double rate = 1 + uniform(rng) / 2;
    const double phase = std::numbers::pi * uniform(rng);
    for (int f = 0; f < num_frames; ++f) {
      const double wave = std::sin(phase + rate * 2 * std::numbers::pi * f / num_frames);
      poses(n, f) = n < 6 ? 0.5 * wave : lower[n] + (0.5 + 0.5 * wave) * (upper[n] - lower[n]);
    }
  }
  for (int f = 0; f < num_frames; ++f) {
    const Eigen::Vector3d turn(0, 4 * std::numbers::pi * f / num_frames, 0);
    const Eigen::Vector3d sway = poses.col(f).segment<3>(3);
    poses.col(f).segment<3>(3) = LogSO3(ExpSO3(turn) * ExpSO3(sway));
  }
  return poses;
}

}  // namespace mpc::testing
