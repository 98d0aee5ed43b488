#include "mpc/eval/motions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/eval/metrics.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

class MotionsTest : public ::testing::TestWithParam<MotionKind> {
 protected:
  Skeleton skeleton_ = DefaultSkeleton();
};

TEST_P(MotionsTest, StaysInsideTheBoundsAndOnTheFloor) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, GetParam(), 4, 30);
  ASSERT_EQ(poses.cols(), 120);
  ASSERT_TRUE(poses.allFinite());
  for (int f = 0; f < poses.cols(); ++f) {
    EXPECT_TRUE((poses.col(f).array() >= skeleton_.LowerBounds().array()).all());
    EXPECT_TRUE((poses.col(f).array() <= skeleton_.UpperBounds().array()).all());
  }
  const Eigen::MatrixXd joints = JointTrajectories(skeleton_, poses);
  Eigen::VectorXd lowest(poses.cols());
  for (int f = 0; f < poses.cols(); ++f) {
    lowest[f] = joints.col(f).reshaped(3, skeleton_.num_joints()).row(1).minCoeff();
  }
  EXPECT_NEAR(lowest.minCoeff(), 0, 1e-12);
  if (GetParam() != MotionKind::kJump) {
    EXPECT_LT(lowest.maxCoeff(), 0.02);
  }
}

TEST_P(MotionsTest, IsSmooth) {
  const Eigen::MatrixXd joints =
      JointTrajectories(skeleton_, MakeMotion(skeleton_, GetParam(), 4, 60));
  double fastest = 0;
  for (int f = 1; f < joints.cols(); ++f) {
    const Eigen::Matrix3Xd step =
        60 * (joints.col(f) - joints.col(f - 1)).reshaped(3, skeleton_.num_joints());
    fastest = std::max(fastest, step.colwise().norm().maxCoeff());
  }
  // A free fall alone has 9.8 m/s^2.
  const bool vigorous = GetParam() == MotionKind::kJump || GetParam() == MotionKind::kKick;
  EXPECT_LT(fastest, vigorous ? 13 : 8);  // m/s
  EXPECT_GT(fastest, 0.5);
  EXPECT_LT(Jitter(joints, 60).mean_mm_per_s2, vigorous ? 18e3 : 12e3);
}

INSTANTIATE_TEST_SUITE_P(All, MotionsTest, ::testing::ValuesIn(kAllMotions),
                         [](const auto& kind) { return std::string(MotionName(kind.param)); });

TEST_F(MotionsTest, TheTurnGoesAroundTwice) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kTurn, 4, 30);
  double angle = 0;
  for (int f = 1; f < poses.cols(); ++f) {
    const Eigen::Matrix3d step =
        ExpSO3(poses.col(f).segment<3>(3)) * ExpSO3(poses.col(f - 1).segment<3>(3)).transpose();
    angle += LogSO3(step).y();
  }
  EXPECT_NEAR(angle, 4 * std::numbers::pi, 0.01);
}

TEST_F(MotionsTest, TheWalkersStandingFootDoesNotSlide) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kWalk, 4, 60);
  const Eigen::MatrixXd joints = JointTrajectories(skeleton_, poses);
  double slide = 0;
  double root = 0;
  for (int f = 1; f < joints.cols(); ++f) {
    const Eigen::Matrix3Xd now = joints.col(f).reshaped(3, skeleton_.num_joints());
    const Eigen::Matrix3Xd before = joints.col(f - 1).reshaped(3, skeleton_.num_joints());
    int lowest = 0;
    now.row(1).minCoeff(&lowest);
    slide += 60 * (now.col(lowest) - before.col(lowest)).norm();
    root += 60 * (poses.col(f) - poses.col(f - 1)).head<3>().norm();
  }
  EXPECT_GT(root / 239, 0.7);  // m/s
  EXPECT_LT(slide, 0.15 * root);
}

// How far the toes of the standing feet move along the floor, in all.
double ToeSlide(const Skeleton& skeleton, const Eigen::MatrixXd& poses, JointId toe) {
  const Eigen::MatrixXd x =
      JointTrajectories(skeleton, poses).middleRows<3>(3 * skeleton.FindJointIndex(toe));
  return (x.colwise() - x.col(0)).topRows<3>().colwise().norm().maxCoeff();
}

TEST_F(MotionsTest, StandingFeetStayPlanted) {
  for (const MotionKind kind :
       {MotionKind::kSit, MotionKind::kBend, MotionKind::kWave, MotionKind::kKick}) {
    SCOPED_TRACE(MotionName(kind));
    const Eigen::MatrixXd poses = MakeMotion(skeleton_, kind, 4, 60);
    EXPECT_LT(ToeSlide(skeleton_, poses, JointId::kLeftToe), 0.06);
  }
}

TEST_F(MotionsTest, AJumpFallsFreely) {
  const double fps = 120;
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kJump, 2.2, fps);
  const Eigen::MatrixXd joints = JointTrajectories(skeleton_, poses);
  int in_air = 0;
  for (int f = 1; f + 1 < poses.cols(); ++f) {
    const auto lowest = [&](int frame) {
      return joints.col(frame).reshaped(3, skeleton_.num_joints()).row(1).minCoeff();
    };
    if (std::min({lowest(f - 1), lowest(f), lowest(f + 1)}) < 0.03) continue;
    ++in_air;
    const double acceleration = (poses(1, f + 1) - 2 * poses(1, f) + poses(1, f - 1)) * fps * fps;
    EXPECT_NEAR(acceleration, -9.81, 0.01);
  }
  EXPECT_GT(in_air / fps, 0.3);
  EXPECT_LT(ToeSlide(skeleton_, poses.leftCols(60), JointId::kLeftToe), 0.10);
}

TEST_F(MotionsTest, TurningAroundLooksBack) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kTurnAround, 4, 30);
  EXPECT_GT(ExpSO3(poses.col(0).segment<3>(3))(2, 2), 0.99);
  EXPECT_LT(ExpSO3(poses.col(119).segment<3>(3))(2, 2), -0.99);
  // Away and back again.
  EXPECT_GT(poses(2, 60), poses(2, 0) + 0.4);
  EXPECT_GT(poses(2, 60), poses(2, 119) + 0.4);
}

TEST_F(MotionsTest, WorksForAnyHeight) {
  const Skeleton child = DefaultSkeleton(1.1);
  EXPECT_TRUE(MakeMotion(child, MotionKind::kSquat, 1, 24).allFinite());
}

TEST_F(MotionsTest, UnusableInputIsRefused) {
  EXPECT_THROW(MakeMotion(skeleton_, MotionKind::kWalk, 0, 30), Error);
  EXPECT_THROW(MakeMotion(skeleton_, MotionKind::kWalk, 1e12, 30), Error);
  EXPECT_THROW(MakeMotion(skeleton_, MotionKind::kWalk, std::nan(""), 30), Error);
  Skeleton other = skeleton_;
  other.hinges[0].name = "unheard_of";
  EXPECT_THROW(MakeMotion(other, MotionKind::kReach, 1, 30), Error);
}

TEST_F(MotionsTest, TransformedPosesHaveTransformedJoints) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kWalk, 1, 10);
  const Eigen::Matrix3d rotation = ExpSO3({2, 1, -1});
  const Eigen::Vector3d translation(1, 2, 3);
  const Eigen::MatrixXd before = JointTrajectories(skeleton_, poses);
  const Eigen::MatrixXd after =
      JointTrajectories(skeleton_, TransformPoses(rotation, translation, poses));
  for (int f = 0; f < poses.cols(); ++f) {
    for (int row = 0; row < before.rows(); row += 3) {
      const Eigen::Vector3d expected = rotation * before.col(f).segment<3>(row) + translation;
      EXPECT_LT((after.col(f).segment<3>(row) - expected).norm(), 1e-12);
    }
  }
}

TEST_F(MotionsTest, ResamplingToTheSameRateChangesNothing) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kTurn, 2, 25);
  EXPECT_LT((JointTrajectories(skeleton_, ResamplePoses(poses, 25, 25)) -
             JointTrajectories(skeleton_, poses))
                .cwiseAbs()
                .maxCoeff(),
            1e-12);
}

TEST_F(MotionsTest, ResamplingIsExactForConstantSpeed) {
  Eigen::MatrixXd poses(skeleton_.num_dofs(), 40);
  const Eigen::Matrix3d start = ExpSO3({1, -2, 0.5});
  const auto pose_at = [&](double t) {
    Eigen::VectorXd pose = Eigen::VectorXd::Constant(skeleton_.num_dofs(), 0.1 + 0.2 * t);
    pose.segment<3>(3) = LogSO3(start * ExpSO3(t * Eigen::Vector3d(0.5, 4, 1)));
    return pose;
  };
  for (int f = 0; f < 40; ++f) poses.col(f) = pose_at(f / 30.0);
  const Eigen::MatrixXd resampled = ResamplePoses(poses, 30, 47);
  ASSERT_EQ(resampled.cols(), static_cast<int>(39 * 47 / 30.0) + 1);
  for (int i = 0; i < resampled.cols(); ++i) {
    const Eigen::VectorXd expected = pose_at(i / 47.0);
    EXPECT_LT((ExpSO3(resampled.col(i).segment<3>(3)) - ExpSO3(expected.segment<3>(3))).norm(),
              1e-9);
    EXPECT_NEAR(resampled(10, i), expected[10], 1e-12);
  }
}

TEST_F(MotionsTest, ResamplingRefusesNonsense) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kTurn, 2, 25);
  EXPECT_THROW(ResamplePoses(poses, 0, 30), Error);
  EXPECT_THROW(ResamplePoses(poses, 30, -1), Error);
  EXPECT_THROW(ResamplePoses(poses, 1, 1e9), Error);
}

}  // namespace
}  // namespace mpc
