#include "mpc/pose/calibration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pose/synthetic_clip.h"

namespace mpc {
namespace {

double Stature(const Skeleton& skeleton) {
  KinematicState rest;
  ForwardKinematics(skeleton, ZeroPose(skeleton), &rest);
  const auto height = [&](JointId id) { return rest.joints(1, skeleton.FindJointIndex(id)); };
  return height(JointId::kHeadTop) -
         0.5 * (height(JointId::kLeftAnkle) + height(JointId::kRightAnkle));
}

PoseTrack FitProportions(const testing::SyntheticClip& clip) {
  PoseOptions options = testing::PlainOptions();
  options.fit_proportions = true;
  return EstimatePoses(DefaultSkeleton(), clip.camera, clip.detections.detections2d,
                       &clip.detections.detections3d, clip.fps, options);
}

Proportions LongTorsoAndThighs() {
  Proportions known;
  known.part = {1.06, 0.93, 1, 1, 1.08, 0.92, 1.1, 0.93, 1};
  return known;
}

// The overall size cannot be seen: the proportions are compared at equal stature.
void ExpectProportions(const PoseTrack& track, const Proportions& known, double tolerance,
                       double sigmas) {
  const double size = Stature(ScaledSkeleton(DefaultSkeleton(), known)) /
                      Stature(ScaledSkeleton(DefaultSkeleton(), track.proportions));
  for (int p = 0; p < kNumBodyParts; ++p) {
    EXPECT_NEAR(size * track.proportions.part[p], known.part[p],
                tolerance + sigmas * track.uncertainty.part[p])
        << BodyPartName(static_cast<BodyPart>(p));
  }
}

TEST(CalibrationTest, ARescaledObservationIsTheOneOfTheOtherSkeleton) {
  const testing::SyntheticClip clip =
      testing::MakeClip(MotionKind::kReach, 5, 30, DetectionNoise::White(5, 60, 0, 0.2), 3);
  const ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                              &clip.detections.detections3d, clip.fps, testing::PlainOptions());
  const ClipEvidence other =
      evidence.ForSkeleton(ScaledSkeleton(clip.skeleton, LongTorsoAndThighs()));
  for (int f = 0; f < 5; ++f) {
    const FrameObservation rescaled = other.Rescaled(evidence.Observe(f));
    const FrameObservation observed = other.Observe(f);
    EXPECT_NEAR(rescaled.scale_3d, observed.scale_3d, 1e-12);
    ASSERT_EQ(rescaled.bone, observed.bone);
    for (size_t i = 0; i < observed.bone.size(); ++i) {
      EXPECT_LT((rescaled.bone_vector[i] - observed.bone_vector[i]).norm(), 1e-12);
    }
  }
}

TEST(CalibrationTest, FindsKnownProportions) {
  const Proportions known = LongTorsoAndThighs();
  const Skeleton performer = ScaledSkeleton(DefaultSkeleton(), known);
  const PoseTrack track =
      FitProportions(testing::MakeClip(MotionKind::kReach, 100, 30, {}, 1, performer));
  // The prior pulls where little is known.
  ExpectProportions(track, known, 0.03, 0);
  EXPECT_EQ(track.proportions.overall, 1);
}

// White errors average out over all frames, without a bias to larger or smaller parts.
TEST(CalibrationTest, WhiteNoiseDoesNotBiasIt) {
  const DetectionNoise noise = DetectionNoise::White(5, 60, 0.1, 0.2);
  for (const Proportions& known : {Proportions{}, LongTorsoAndThighs()}) {
    const Skeleton performer = ScaledSkeleton(DefaultSkeleton(), known);
    const PoseTrack track =
        FitProportions(testing::MakeClip(MotionKind::kWalk, 100, 30, noise, 1, performer));
    ExpectProportions(track, known, 0.04, 0);
  }
}

TEST(CalibrationTest, KeepsTheStature) {
  const Skeleton performer = ScaledSkeleton(DefaultSkeleton(), LongTorsoAndThighs());
  const PoseTrack track = FitProportions(testing::MakeClip(
      MotionKind::kWalk, 60, 30, DetectionNoise::White(3, 30, 0, 0), 2, performer));
  EXPECT_NEAR(Stature(ScaledSkeleton(DefaultSkeleton(), track.proportions)),
              Stature(DefaultSkeleton()), 0.003);
}

TEST(CalibrationTest, NobodySeenIsTheRigItself) {
  const testing::SyntheticClip clip =
      testing::MakeClip(MotionKind::kWalk, 5, 30, {.gaps = {{0, 5}}}, 1);
  const PoseOptions options = testing::PlainOptions();
  ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                        &clip.detections.detections3d, clip.fps, options);
  FrameInitialization start;
  start.poses = clip.poses;
  start.observed.assign(5, false);
  start.swaps.assign(5, SideSwap::kNone);
  start.observations.resize(5);
  ProportionsCalibration calibration(clip.skeleton);
  calibration.Step(MakeWindows(5, 50, 10), start.poses, 1, &evidence, &start);
  for (int p = 0; p < kNumBodyParts; ++p) {
    EXPECT_EQ(calibration.proportions().part[p], 1);
    EXPECT_GT(calibration.uncertainty().part[p], 0.02);
  }
}

}  // namespace
}  // namespace mpc
