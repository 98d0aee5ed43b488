#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "eval/bvh_source.h"
#include "mpc/eval/metrics.h"
#include "mpc/eval/retarget.h"
#include "mpc/io/bvh.h"
#include "mpc/skeleton/kinematics.h"
#include "support/data_dir.h"

namespace mpc {
namespace {

class RetargetDataTest : public ::testing::TestWithParam<const char*> {};

TEST_P(RetargetDataTest, FollowsRealMotion) {
  MPC_REQUIRE_DATA();
  const std::filesystem::path file =
      *testing::DataDir() / "mocap" / (std::string(GetParam()) + ".bvh");
  const SourceMotion source = testing::SourceFromBvh(ReadBvh(file));
  const Skeleton skeleton = DefaultSkeleton();
  RetargetSummary summary;
  const Eigen::MatrixXd poses = Retarget(skeleton, source, &summary);
  ASSERT_TRUE(poses.allFinite());
  ASSERT_EQ(poses.cols(), static_cast<int>(source.joint_positions.size()));
  EXPECT_LT(summary.mean_direction_error_rad, 0.03);
  EXPECT_LT(summary.max_direction_error_rad, 0.09);

  const Eigen::MatrixXd joints = JointTrajectories(skeleton, poses);
  Eigen::VectorXd lowest(poses.cols());
  for (int f = 0; f < poses.cols(); ++f) {
    EXPECT_TRUE((poses.col(f).array() >= skeleton.LowerBounds().array()).all());
    EXPECT_TRUE((poses.col(f).array() <= skeleton.UpperBounds().array()).all());
    lowest[f] = joints.col(f).reshaped(3, skeleton.num_joints()).row(1).minCoeff();
  }
  EXPECT_GT(lowest.minCoeff(), -0.06);
  std::sort(lowest.begin(), lowest.end());
  EXPECT_NEAR(lowest[lowest.size() / 4], 0, 0.03) << "often on the floor";
  EXPECT_LT(lowest.maxCoeff(), 0.5);

  // No rougher than the source: jumps between solutions would show.
  Eigen::MatrixXd theirs(3 * source.names.size(), poses.cols());
  for (int f = 0; f < poses.cols(); ++f) {
    theirs.col(f) = summary.scale * source.joint_positions[f].reshaped();
  }
  EXPECT_LT(Jitter(joints, source.fps).mean_mm_per_frame2,
            1.2 * Jitter(theirs, source.fps).mean_mm_per_frame2);
}

INSTANTIATE_TEST_SUITE_P(Mocap, RetargetDataTest,
                         ::testing::Values("cmu_02_01_walk", "cmu_02_04_jump_balance",
                                           "cmu_02_05_punch_strike", "deepmimic_kick",
                                           "deepmimic_roll", "animateddrawings_jesse_dance"),
                         [](const auto& name) { return std::string(name.param); });

}  // namespace
}  // namespace mpc
