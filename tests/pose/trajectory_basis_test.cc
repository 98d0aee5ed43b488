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

// With noise of variance v on the data and coefficients of variance c, the cost (x - data)^2 +
// share weight x^2 must shrink the data by c / (c + v): the Wiener filter.
TEST(AdaptedSharesTest, AreTheWienerFilter) {
  const double variance = 4;
  const double weight = 3;
  const double noise = 0.5;
  const Eigen::MatrixXd coefficients = Eigen::MatrixXd::Constant(1, 9, std::sqrt(variance));
  const Eigen::MatrixXd shares =
      AdaptedShares(coefficients, Eigen::VectorXd::Constant(1, weight), noise, 0.999);
  EXPECT_EQ(shares(0, 0), 0);
  for (int k = 1; k < 9; ++k) {
    EXPECT_NEAR(1 / (1 + shares(0, k) * weight), variance / (variance + noise), 1e-12);
  }
}

TEST(AdaptedSharesTest, EachDofFollowsItsOwnSpectrum) {
  Eigen::MatrixXd coefficients = Eigen::MatrixXd::Zero(3, 10);
  coefficients.row(0).setConstant(1);          // moves at all frequencies
  coefficients.row(1).head(4).setConstant(1);  // slowly
  const Eigen::MatrixXd shares =
      AdaptedShares(coefficients, Eigen::VectorXd::Constant(3, 100), 0.1, 0.999);
  EXPECT_LT(shares.row(0).maxCoeff(), 0.01);
  EXPECT_LT(shares(1, 2), 0.01);
  EXPECT_EQ(shares(1, 9), 0.999);  // nothing there
  EXPECT_EQ(shares.row(2).tail(9).minCoeff(), 0.999);
  EXPECT_TRUE(shares.allFinite());
}

}  // namespace
}  // namespace mpc
