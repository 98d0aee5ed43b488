#include "mpc/eval/foot_skate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "mpc/core/units.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitY();

class FootSkateTest : public ::testing::Test {
 protected:
  // Toe 0 stands for frames 0..4 and then steps 0.3 m per frame; ankle 1 swings all the time; the
  // wrist rests, but is no foot.
  FootSkateTest() : truth_(9, 8) {
    for (int f = 0; f < 8; ++f) {
      truth_.col(f) << std::max(0, f - 4) * 0.3, 0, 1, 0.2 * f, 0.1, 2, 0, 1, 0;
    }
  }
  std::vector<JointId> joints_ = {JointId::kLeftToe, JointId::kRightAnkle, JointId::kLeftWrist};
  Eigen::MatrixXd truth_;
};

TEST_F(FootSkateTest, TruthAgainstItselfIsExactlyZero) {
  const FootSkate skate = CompareFootSkate(joints_, truth_, truth_, 30, kUp);
  EXPECT_EQ(skate.mean_mm, 0);
  EXPECT_EQ(skate.num_contacts, 4);
  EXPECT_EQ(skate.num_frames, 4);
}

TEST_F(FootSkateTest, ASlideOverTheFloorIsSeenAndLiftingIsNot) {
  Eigen::MatrixXd estimate = truth_;
  for (int f = 0; f < 8; ++f) estimate.col(f).array() += 0.1;  // elsewhere, at rest
  EXPECT_NEAR(CompareFootSkate(joints_, estimate, truth_, 30, kUp).mean_mm, 0, 1e-10);
  for (int f = 0; f < 8; ++f) estimate.col(f).segment<3>(0) += Eigen::Vector3d(3, 7, 4) * 1e-3 * f;
  const FootSkate skate = CompareFootSkate(joints_, estimate, truth_, 30, kUp);
  EXPECT_NEAR(skate.mean_mm, 5, 1e-9);
  EXPECT_NEAR(skate.per_frame_mm[0], 5, 1e-9);
  EXPECT_TRUE(std::isnan(skate.per_frame_mm[4]));
  EXPECT_TRUE(std::isnan(skate.per_frame_mm[7]));
}

TEST_F(FootSkateTest, WhatIsHighOrFastIsNoContact) {
  Eigen::MatrixXd truth = truth_;
  truth.row(1).head<3>().setConstant(0.06);  // the toe comes down to the floor in frame 3
  EXPECT_EQ(CompareFootSkate(joints_, truth, truth, 30, kUp).num_contacts, 1);
  // At a thousandth of the rate the same steps are slow.
  EXPECT_EQ(CompareFootSkate(joints_, truth_, truth_, 0.03, kUp).num_contacts, 14);
  // Along another axis the wall is the floor.
  EXPECT_EQ(CompareFootSkate(joints_, truth_, truth_, 30, Eigen::Vector3d::UnitX()).num_contacts,
            4);
}

TEST_F(FootSkateTest, MissingJointsMakeNoContact) {
  Eigen::MatrixXd estimate = truth_;
  estimate(0, 1) = kNan;
  EXPECT_EQ(CompareFootSkate(joints_, estimate, truth_, 30, kUp).num_contacts, 2);
  const FootSkate none =
      CompareFootSkate(joints_, Eigen::MatrixXd::Constant(9, 8, kNan), truth_, 30, kUp);
  EXPECT_EQ(none.num_contacts, 0);
  EXPECT_TRUE(std::isnan(none.mean_mm));
}

TEST_F(FootSkateTest, RefusesWhatDoesNotFit) {
  const auto compare = [&](const Eigen::MatrixXd& estimate, double fps, const Eigen::Vector3d& up) {
    CompareFootSkate(joints_, estimate, truth_, fps, up);
  };
  EXPECT_MPC_ERROR(compare(truth_.leftCols(7), 30, kUp), kMismatch, "9 x 7");
  EXPECT_MPC_ERROR(compare(truth_, 0, kUp), kInvalidArgument, "frame rate");
  EXPECT_MPC_ERROR(compare(truth_, 30, 2 * kUp), kInvalidArgument, "unit vector");
}

}  // namespace
}  // namespace mpc
