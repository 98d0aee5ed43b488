// Feet that stand: when they are found, where, and what holding them does to an estimate.
#include "mpc/pose/standing_feet.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "pose/synthetic_clip.h"

namespace mpc {
namespace {

using testing::MakeClip;
using testing::SyntheticClip;

constexpr double kFps = 30;
constexpr int kFrames = 90;

// The stands found in `poses` of a clip's person.
std::vector<FrameObservation> Stands(const SyntheticClip& clip, const Eigen::MatrixXd& poses,
                                     std::span<const CameraFromWorld> camera_motion = {}) {
  const ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                              &clip.detections.detections3d, clip.fps, testing::PlainOptions(),
                              camera_motion);
  std::vector<FrameObservation> observations;
  observations.reserve(static_cast<size_t>(clip.num_frames()));
  for (int f = 0; f < clip.num_frames(); ++f) observations.push_back(evidence.Observe(f));
  FindStandingFeet(evidence, poses, &observations);
  return observations;
}

// Null when the joint does not stand.
const StandingJoint* Find(const FrameObservation& observation, int joint) {
  const auto found =
      std::find_if(observation.standing.begin(), observation.standing.end(),
                   [&](const StandingJoint& standing) { return standing.joint == joint; });
  return found == observation.standing.end() ? nullptr : &*found;
}

TEST(StandingFeetTest, FeetOfWhoeverSquatsStandWhereTheyAre) {
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, {}, 1);
  // An estimate whose feet drift to and fro along their ray.
  KinematicState state;
  ForwardKinematics(clip.skeleton, clip.poses.col(0), &state);
  const Eigen::Vector3d ray =
      state.joints.col(clip.skeleton.FindJointIndex(JointId::kLeftAnkle)).normalized();
  Eigen::MatrixXd poses = clip.poses;
  for (int f = 0; f < kFrames; ++f) {
    poses.col(f).head<3>() += 0.08 * std::sin(2 * std::numbers::pi * f / kFrames) * ray;
  }
  const std::vector<FrameObservation> observations = Stands(clip, poses);
  double worst_m = 0;
  for (int f = 0; f < kFrames; ++f) {
    EXPECT_EQ(observations[f].standing.size(), 4U) << "frame " << f;
    ForwardKinematics(clip.skeleton, clip.poses.col(f), &state);
    for (const StandingJoint& standing : observations[f].standing) {
      worst_m =
          std::max(worst_m, std::abs(standing.range_m - state.joints.col(standing.joint).norm()));
    }
  }
  EXPECT_LT(worst_m, 0.02);  // the drift is 0.08
}

// An estimate that runs away along the ray of a foot: the picture shows it standing before, after and
// meanwhile.
TEST(StandingFeetTest, AFootThatStoodGoesOnStandingUntilItIsSeenToMove) {
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, {}, 1);
  const int ankle = clip.skeleton.FindJointIndex(JointId::kLeftAnkle);
  KinematicState state;
  ForwardKinematics(clip.skeleton, clip.poses.col(0), &state);
  const Eigen::Vector3d ray = state.joints.col(ankle).normalized();
  Eigen::MatrixXd poses = clip.poses;
  const int middle = kFrames / 2;
  const int reach = kFrames / 6;
  for (int f = middle - reach; f <= middle + reach; ++f) {
    const double share = 0.5 + 0.5 * std::cos(std::numbers::pi * (f - middle) / reach);
    poses.col(f).head<3>() += 0.4 * share * ray;
  }
  const std::vector<FrameObservation> observations = Stands(clip, poses);
  const StandingJoint* found = Find(observations[middle], ankle);
  ASSERT_NE(found, nullptr);
  ForwardKinematics(clip.skeleton, clip.poses.col(middle), &state);
  EXPECT_NEAR(found->range_m, state.joints.col(ankle).norm(), 0.03);
}

// A jump: the feet stand until they leave the floor and from when they are back, to within a frame.
TEST(StandingFeetTest, AFootStandsUntilItHasMoved) {
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, {}, 1);
  constexpr int kTakeOff = 40;
  constexpr int kLanding = 52;
  constexpr double kGravity = 9.81;
  Eigen::MatrixXd poses = clip.poses.col(0).replicate(1, kFrames);
  for (int f = kTakeOff; f < kLanding; ++f) {
    const double rise_m = 0.5 * kGravity * (f - kTakeOff) * (kLanding - f) / (kFps * kFps);
    poses(1, f) -= rise_m;  // the camera's y is down
  }
  const std::vector<FrameObservation> observations = Stands(clip, poses);
  const int toe = clip.skeleton.FindJointIndex(JointId::kLeftToe);
  for (int f = 0; f < kFrames; ++f) {
    // It has risen 6 cm in the first frame of the flight, and has them left in the last.
    const bool stands = f <= kTakeOff || f >= kLanding;
    EXPECT_EQ(Find(observations[f], toe) != nullptr, stands) << "frame " << f;
  }
}

// An estimate whose left foot points up, toe as high as a step, on an ankle that stands on the floor.
TEST(StandingFeetTest, AToeStandsOnTheFloorOfItsAnkle) {
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, {}, 1);
  const int toe = clip.skeleton.FindJointIndex(JointId::kLeftToe);
  const auto& hinges = clip.skeleton.hinges;
  const auto bends = std::find_if(hinges.begin(), hinges.end(), [&](const auto& hinge) {
    return hinge.segment == clip.skeleton.joints[toe].segment;
  });
  ASSERT_NE(bends, hinges.end());
  Eigen::MatrixXd poses = clip.poses;
  poses.row(6 + (bends - hinges.begin())).array() += 1.2;
  const std::vector<FrameObservation> observations = Stands(clip, poses);
  const StandingJoint* found = Find(observations[0], toe);
  ASSERT_NE(found, nullptr);
  KinematicState state;
  ForwardKinematics(clip.skeleton, poses.col(0), &state);
  EXPECT_GT(found->range_m, state.joints.col(toe).norm() + 0.02);
}

// The same squat before a camera in a hand: sways by 10 cm and 3 degrees, twice a second.
TEST(StandingFeetTest, ACameraThatIsKnownToMoveSeesTheSameStands) {
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, {}, 1);
  Eigen::MatrixXd poses = clip.poses;
  std::vector<CameraFromWorld> motion;
  for (int f = 0; f < kFrames; ++f) {
    const double sway = std::sin(2 * std::numbers::pi * 2 * f / kFps);
    motion.push_back({ExpSO3({0.05 * sway, -0.05 * sway, 0}), {0.1 * sway, 0, -0.05 * sway}});
    poses.col(f) =
        TransformPoses(motion.back().rotation, motion.back().translation, clip.poses.col(f));
  }
  // The world has y down, as the clip's camera at rest.
  const std::vector<FrameObservation> observations = Stands(clip, poses, motion);
  KinematicState state;
  for (int f = 0; f < kFrames; ++f) {
    EXPECT_EQ(observations[f].standing.size(), 4U) << "frame " << f;
    ForwardKinematics(clip.skeleton, poses.col(f), &state);
    for (const StandingJoint& standing : observations[f].standing) {
      EXPECT_NEAR(standing.range_m, state.joints.col(standing.joint).norm(), 0.02);
      EXPECT_LT(standing.ray.cross(state.joints.col(standing.joint)).norm(), 1e-6);
    }
  }
  int num_unknown = 0;
  for (const FrameObservation& observation : Stands(clip, poses)) {
    num_unknown += static_cast<int>(observation.standing.size());
  }
  EXPECT_LT(num_unknown, kFrames);
}

// After a while that nobody saw, the estimate runs to and fro along the rays and never rests.
TEST(StandingFeetTest, WhatRestsInThePictureAloneStandsOnTheFloorOfOthers) {
  DetectionNoise noise;
  noise.gaps = {{15, 45}};
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, noise, 1);
  const int ankle = clip.skeleton.FindJointIndex(JointId::kLeftAnkle);
  KinematicState state;
  ForwardKinematics(clip.skeleton, clip.poses.col(0), &state);
  const Eigen::Vector3d ray = state.joints.col(ankle).normalized();
  Eigen::MatrixXd poses = clip.poses;
  for (int f = 45; f < kFrames; ++f) {
    const double seconds = (f - 45) / kFps;
    poses.col(f).head<3>() += (0.9 * std::abs(seconds - 0.75) - 0.35) * ray;
  }
  const std::vector<FrameObservation> observations = Stands(clip, poses);
  for (int f = 50; f < kFrames - 5; ++f) {
    const StandingJoint* found = Find(observations[f], ankle);
    ASSERT_NE(found, nullptr) << "frame " << f;
    ForwardKinematics(clip.skeleton, clip.poses.col(f), &state);
    EXPECT_NEAR(found->range_m, state.joints.col(ankle).norm(), 0.1) << "frame " << f;
  }
}

TEST(StandingFeetTest, AWalkersFeetStandByTurns) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, kFrames, kFps, {}, 1);
  const std::vector<FrameObservation> observations = Stands(clip, clip.poses);
  const Eigen::MatrixXd joints = JointTrajectories(clip.skeleton, clip.poses);
  int num_standing = 0;
  for (int f = 1; f + 1 < kFrames; ++f) {
    for (const StandingJoint& standing : observations[f].standing) {
      const auto at = [&](int g) { return joints.col(g).segment<3>(3 * standing.joint); };
      const double after = (at(f + 1) - at(f)).norm() * kFps;
      const double before = (at(f) - at(f - 1)).norm() * kFps;
      // The first frame of a stand and the last border on the swing.
      const bool inner = Find(observations[f - 1], standing.joint) != nullptr &&
                         Find(observations[f + 1], standing.joint) != nullptr;
      EXPECT_LT(inner ? 0.5 * (at(f + 1) - at(f - 1)).norm() * kFps : std::min(before, after), 0.8);
      ++num_standing;
    }
  }
  EXPECT_GT(num_standing, kFrames / 4);  // of four joints per frame: the middles of the steps
  EXPECT_LT(num_standing, 3 * kFrames);
}

// A step of 4 cm: two stands, each at its own place and never both.
TEST(StandingFeetTest, AFootStandsInOnePlaceAtATime) {
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, {}, 1);
  constexpr int kStepFrame = 45;
  Eigen::MatrixXd poses = clip.poses.col(0).replicate(1, kFrames);
  poses.row(0).tail(kFrames - kStepFrame).array() += 0.04;
  const std::vector<FrameObservation> observations = Stands(clip, poses);
  const int ankle = clip.skeleton.FindJointIndex(JointId::kLeftAnkle);
  for (int f = 0; f < kFrames; ++f) {
    const auto& standing = observations[f].standing;
    EXPECT_LE(std::count_if(standing.begin(), standing.end(),
                            [&](const StandingJoint& s) { return s.joint == ankle; }),
              1)
        << "frame " << f;
  }
}

// How far below the floor of their frame the deepest joint of a foot is, m; negative above it.
double DeepestJoint(const SyntheticClip& clip, const Eigen::MatrixXd& poses,
                    const std::vector<FrameObservation>& observations, int f) {
  KinematicState state;
  ForwardKinematics(clip.skeleton, poses.col(f), &state);
  double deepest_m = -std::numeric_limits<double>::infinity();
  for (const StandingJoint& floor : observations[f].floor) {
    EXPECT_TRUE(floor.one_sided);
    deepest_m = std::max(deepest_m, floor.ray.dot(state.joints.col(floor.joint)) - floor.range_m);
  }
  return deepest_m;
}

// The clip's camera looks level: y is down.
void Sink(int first, int end, double by_m, Eigen::MatrixXd* poses) {
  poses->row(1).segment(first, end - first).array() += by_m;
}

TEST(StandingFeetTest, TheFloorIsUnderAllFramesOfTheClip) {
  const SyntheticClip clip = MakeClip(MotionKind::kJump, kFrames, kFps, {}, 1);
  Eigen::MatrixXd poses = clip.poses;
  Sink(40, 44, 0.12, &poses);  // too short to be a stand
  const std::vector<FrameObservation> observations = Stands(clip, poses);
  double lowest_m = -1;
  for (int f = 0; f < kFrames; ++f) {
    ASSERT_EQ(observations[f].floor.size(), 4U) << "frame " << f;
    const double deep_m = DeepestJoint(clip, clip.poses, observations, f);
    EXPECT_LT(deep_m, 0.02) << "frame " << f;
    lowest_m = std::max(lowest_m, deep_m);
    if (f < 40 || f >= 44) continue;
    EXPECT_NEAR(DeepestJoint(clip, poses, observations, f), deep_m + 0.12, 1e-3);
  }
  EXPECT_GT(lowest_m, -0.02);
}

TEST(StandingFeetTest, ThePoseOfAFrameCostsWhatIsUnderTheFloor) {
  const SyntheticClip clip = MakeClip(MotionKind::kJump, kFrames, kFps, {}, 1);
  const ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                              &clip.detections.detections3d, clip.fps, testing::PlainOptions());
  const std::vector<FrameObservation> observations = Stands(clip, clip.poses);
  const auto cost = [&](double sunk_m, const FrameObservation& observation) {
    PosePoint at;
    at.pose = clip.poses.col(0);
    at.pose[1] += sunk_m;
    at.root_rotation = ExpSO3(at.pose.segment<3>(3));
    at.Update(clip.skeleton, /*with_jacobian=*/false);
    FrameScratch scratch;
    return EvaluateFrame(
        evidence.MakeProblem(observation, at.pose[2], 1, RelaxedPose(clip.skeleton)), at, &scratch);
  };
  FrameObservation floorless = observations[0];
  floorless.floor.clear();
  const auto of_floor = [&](double sunk_m) {
    return cost(sunk_m, observations[0]) - cost(sunk_m, floorless);
  };
  EXPECT_LT(of_floor(-0.1), 1e-9);
  EXPECT_GT(of_floor(0.1), kNoiseCost);
}

TEST(StandingFeetTest, WhoeverGoesDownAStepWithBothFeetHasALowerFloor) {
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, {}, 1);
  Eigen::MatrixXd poses = clip.poses;
  Sink(60, kFrames, 0.3, &poses);
  std::vector<FrameObservation> observations = Stands(clip, poses);
  EXPECT_NEAR(DeepestJoint(clip, poses, observations, 80), 0, 0.03);
  // The same with a right foot that is lifted meanwhile: a left leg that is alone down there.
  const int knee = clip.skeleton.FindJointIndex(JointId::kRightKnee);
  const auto& hinges = clip.skeleton.hinges;
  const auto bends = std::find_if(hinges.begin(), hinges.end(), [&](const auto& hinge) {
    return hinge.segment == clip.skeleton.joints[knee].segment;
  });
  ASSERT_NE(bends, hinges.end());
  poses.row(6 + (bends - hinges.begin())).tail(kFrames - 60).array() += 1.5;
  observations = Stands(clip, poses);
  EXPECT_NEAR(DeepestJoint(clip, poses, observations, 80), 0.3, 0.03);
}

TEST(StandingFeetTest, WhatNobodySeesDoesNotStand) {
  DetectionNoise noise;
  noise.gaps = {{30, 60}};
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, kFrames, kFps, noise, 1);
  const std::vector<FrameObservation> observations = Stands(clip, clip.poses);
  EXPECT_FALSE(observations[10].standing.empty());
  EXPECT_TRUE(observations[45].standing.empty());
}

}  // namespace
}  // namespace mpc
