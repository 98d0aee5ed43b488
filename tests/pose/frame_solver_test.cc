// One frame on its own: the solver and the initialisation from any facing.
#include "mpc/pose/frame_solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "mpc/pose/frame_initializer.h"
#include "pose/synthetic_clip.h"

namespace mpc {
namespace {

using Eigen::VectorXd;
using testing::Terms;

class FrameSolverTest : public ::testing::Test {
 protected:
  // A pose in mid-walk and a start off by some 10 degrees and 10 cm.
  FrameSolverTest() {
    std::mt19937 rng(8);
    std::normal_distribution<double> normal(0, 0.15);
    const Eigen::MatrixXd poses = testing::MotionInCamera(skeleton_, MotionKind::kWalk, 20, 30);
    truth_ = poses.col(13);
    start_ = truth_;
    for (double& x : start_) x += normal(rng);
    problem_ = Problem(Terms::kPaper, 0);
  }

  FrameProblem Problem(Terms terms, double noise) {
    std::mt19937 rng(9);
    return testing::MakeIngredients(skeleton_, camera_, truth_, terms, 5 * noise, 40 * noise, &rng)
        .Problem(camera_);
  }

  double JointError(const VectorXd& pose) const {
    KinematicState a, b;
    ForwardKinematics(skeleton_, truth_, &a);
    ForwardKinematics(skeleton_, pose, &b);
    return (a.joints - b.joints).leftCols<kNumPaperJoints>().colwise().norm().maxCoeff();
  }

  Skeleton skeleton_ = DefaultSkeleton();
  Camera camera_ = testing::SyntheticCamera();
  VectorXd truth_, start_;
  FrameProblem problem_;
  FrameSolveScratch scratch_;
};

TEST_F(FrameSolverTest, RecoversAKnownPose) {
  VectorXd pose = start_;
  const SolveSummary summary = SolveFrame(
      skeleton_, problem_, {.max_iterations = 100, .relative_tolerance = 1e-9}, &pose, &scratch_);
  EXPECT_GT(summary.initial_cost, 1000);
  EXPECT_LT(summary.final_cost, 1e-3);
  EXPECT_LT(JointError(pose), 1e-3);
}

TEST_F(FrameSolverTest, StaysInBoundsAndNeverGetsWorse) {
  for (double noise = 0; noise < 20; noise += 2.5) {
    for (const Terms terms : {Terms::kPaper, Terms::kOurs}) {
      VectorXd pose = start_;
      pose.tail(skeleton_.hinges.size()).array() -= 1;
      const SolveSummary summary =
          SolveFrame(skeleton_, Problem(terms, noise), {}, &pose, &scratch_);
      EXPECT_LE(summary.final_cost, summary.initial_cost);
      EXPECT_TRUE((pose.array() >= skeleton_.LowerBounds().array()).all());
      EXPECT_TRUE((pose.array() <= skeleton_.UpperBounds().array()).all());
    }
  }
}

TEST_F(FrameSolverTest, AStartBehindTheCameraFails) {
  VectorXd pose = start_;
  pose[2] = -3;
  const SolveSummary summary = SolveFrame(skeleton_, problem_, {}, &pose, &scratch_);
  EXPECT_EQ(summary.termination, Termination::kFailed);
  EXPECT_EQ(pose[2], -3);
}

class FacingTest : public ::testing::TestWithParam<int> {};

TEST_P(FacingTest, PerfectDetectionsGiveThePose) {
  const Skeleton skeleton = DefaultSkeleton();
  const Camera camera = testing::SyntheticCamera();
  const double yaw = GetParam() * std::numbers::pi / 4;
  const Eigen::MatrixXd motion = MakeMotion(skeleton, MotionKind::kWalk, 1, 30).col(13);
  const Eigen::MatrixXd poses =
      TransformPoses(ExpSO3({std::numbers::pi, 0, 0}) * ExpSO3({0, yaw, 0}), {0.3, 0.9, 4}, motion);
  SyntheticDetections seen = PerfectDetections(skeleton, poses, camera, 30);
  // In camera axes: which ray a network's crop was centred on is a guess of a degree or two.
  Eigen::Matrix3Xd& positions = seen.detections3d.frames[0].positions;
  positions = seen.truth.col(0).reshaped(3, kNumPaperJoints);
  seen.detections3d.ray_aligned = false;
  PoseOptions options = testing::PlainOptions();
  options.weight_rest = 1e-3;
  const ClipEvidence evidence(skeleton, camera, seen.detections2d, &seen.detections3d, 30, options);
  const FrameInitialization found = InitializeFrames(evidence);
  ASSERT_TRUE(found.observed[0]);
  EXPECT_EQ(found.swaps[0], SideSwap::kNone);
  const Eigen::MatrixXd joints = JointTrajectories(skeleton, found.poses);
  const Eigen::Matrix3Xd error =
      (joints.topRows<3 * kNumPaperJoints>() - seen.truth).reshaped(3, kNumPaperJoints);
  EXPECT_LT(error.colwise().norm().maxCoeff(), 0.005);
}

INSTANTIATE_TEST_SUITE_P(Eighths, FacingTest, ::testing::Range(0, 8));

}  // namespace
}  // namespace mpc
