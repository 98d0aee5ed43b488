#include "mpc/pose/trajectory_basis.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;

TEST(DctBasisTest, RowsAreOrthonormal) {
  for (const int num_frames : {1, 2, 7, 50, 120}) {
    for (const int size : {1, 2, 8, 50}) {
      const MatrixXd d = DctBasis(size, num_frames);
      ASSERT_EQ(d.rows(), std::min(size, num_frames));
      ASSERT_EQ(d.cols(), num_frames);
      EXPECT_LT((d * d.transpose() - MatrixXd::Identity(d.rows(), d.rows())).norm(), 1e-12);
    }
  }
}

TEST(DctBasisTest, HoldsConstantsAndSlowWaves) {
  const MatrixXd d = DctBasis(8, 50);
  const MatrixXd outside = MatrixXd::Identity(50, 50) - d.transpose() * d;
  EXPECT_LT((Eigen::RowVectorXd::Ones(50) * outside).norm(), 1e-12);
  Eigen::RowVectorXd slow(50), fast(50);
  for (int f = 0; f < 50; ++f) {
    slow[f] = std::cos(std::numbers::pi * 7 * (f + 0.5) / 50);
    fast[f] = std::cos(std::numbers::pi * 8 * (f + 0.5) / 50);
  }
  EXPECT_LT((slow * outside).norm(), 1e-12);
  EXPECT_NEAR((fast * outside).norm(), fast.norm(), 1e-12);
}

TEST(DctBasisTest, ComplementCompletesTheSpace) {
  for (const int size : {1, 8, 49, 50}) {
    const MatrixXd d = DctBasis(size, 50);
    const MatrixXd null = BasisComplement(d);
    ASSERT_EQ(null.rows(), 50 - size);
    EXPECT_LT((null * d.transpose()).norm(), 1e-12);
    const MatrixXd whole = d.transpose() * d + null.transpose() * null;
    EXPECT_LT((whole - MatrixXd::Identity(50, 50)).norm(), 1e-12);
  }
}

TEST(DctBasisTest, NeedsAFrame) {
  EXPECT_MPC_ERROR(DctBasis(8, 0), kInvalidArgument, "at least one frame");
}

TEST(BasisSizeTest, FollowsFrameRateAndCutoff) {
  EXPECT_EQ(BasisSize(50, 30, 2.1), 8);  // the paper's K is a low-pass at 2.1 Hz
  EXPECT_EQ(BasisSize(50, 50, 4), 9);    // 1 + 2 50 4 / 50
  EXPECT_GT(BasisSize(50, 30, 4), BasisSize(50, 60, 4));
  EXPECT_EQ(BasisSize(50, 5, 4), 50);  // all of it: every motion at 5 fps is below 4 Hz
  EXPECT_EQ(BasisSize(50, 240, 0.01), 2);
  EXPECT_EQ(BasisSize(1, 30, 4), 1);
  EXPECT_EQ(BasisSize(2, 240, 4), 2);
  EXPECT_EQ(BasisSize(50, 1e-3, 1000), 50);
}

}  // namespace
}  // namespace mpc
