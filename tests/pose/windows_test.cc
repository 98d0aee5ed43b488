#include "mpc/pose/windows.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "mpc/core/rigid.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd RandomPoses(int num_frames) {
  std::mt19937 rng(5);
  std::normal_distribution<double> normal(0, 0.8);
  MatrixXd poses(9, num_frames);
  for (double& x : poses.reshaped()) x = normal(rng);
  return poses;
}

TEST(WindowsTest, CoverEveryClip) {
  for (int num_frames = 1; num_frames <= 120; ++num_frames) {
    const std::vector<Window> windows = MakeWindows(num_frames, 50, 10);
    ASSERT_FALSE(windows.empty());
    EXPECT_EQ(windows.front().begin, 0);
    EXPECT_EQ(windows.back().end, num_frames);
    for (size_t i = 0; i < windows.size(); ++i) {
      EXPECT_EQ(windows[i].size(), std::min(50, num_frames));
      if (i == 0) continue;
      const int overlap = windows[i - 1].end - windows[i].begin;
      EXPECT_GE(overlap, 10);
      if (i + 1 < windows.size()) {
        EXPECT_EQ(overlap, 10);
      }
      EXPECT_GT(windows[i].end, windows[i - 1].end);
    }
  }
}

TEST(WindowsTest, TheLastOneIsMovedBack) {
  const std::vector<Window> windows = MakeWindows(100, 50, 10);
  ASSERT_EQ(windows.size(), 3u);
  EXPECT_EQ(windows[1].begin, 40);
  EXPECT_EQ(windows[2].begin, 50);
  EXPECT_EQ(windows[2].end, 100);
}

TEST(WindowsTest, BlendingEqualSolutionsChangesNothing) {
  for (const int num_frames : {1, 49, 50, 51, 90, 100, 233}) {
    const MatrixXd poses = RandomPoses(num_frames);
    const std::vector<Window> windows = MakeWindows(num_frames, 50, 10);
    std::vector<MatrixXd> parts;
    for (const Window& window : windows) {
      parts.push_back(poses.middleCols(window.begin, window.size()));
    }
    EXPECT_LT((BlendWindows(windows, parts, num_frames) - poses).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(WindowsTest, BlendsLinearlyFromOneWindowToTheNext) {
  const std::vector<Window> windows = MakeWindows(90, 50, 10);
  ASSERT_EQ(windows.size(), 2u);
  const MatrixXd joined =
      BlendWindows(windows, {MatrixXd::Zero(9, 50), MatrixXd::Constant(9, 50, 1e-3)}, 90);
  for (int f = 0; f < 90; ++f) {
    const double expected = f < 40 ? 0 : f >= 50 ? 1e-3 : 1e-3 * (f - 39) / 11;
    EXPECT_NEAR(joined(0, f), expected, 1e-15) << f;
    EXPECT_NEAR(joined(8, f), expected, 1e-15) << f;
  }
}

TEST(WindowsTest, RotationsBlendAcrossPi) {
  const double pi = std::numbers::pi;
  VectorXd a = VectorXd::Zero(9);
  VectorXd b = VectorXd::Zero(9);
  a.segment<3>(3) = Eigen::Vector3d(0, pi - 0.1, 0);
  b.segment<3>(3) = Eigen::Vector3d(0, -(pi - 0.1), 0);  // 0.2 rad further on
  for (const double w : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    const VectorXd blended = BlendPoses(a, b, w);
    const Eigen::Matrix3d expected = ExpSO3({0, pi - 0.1 + 0.2 * w, 0});
    EXPECT_LT((ExpSO3(blended.segment<3>(3)) - expected).norm(), 1e-12) << w;
  }
}

}  // namespace
}  // namespace mpc
