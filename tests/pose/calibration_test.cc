#include "mpc/pose/calibration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pose/synthetic_clip.h"

namespace mpc {
namespace {

TEST(CalibrationTest, FindsKnownProportions) {
  Proportions known;
  known.part = {1.06, 0.93, 1, 1, 1.08, 0.92, 1.1, 0.93, 1};
  const Skeleton performer = ScaledSkeleton(DefaultSkeleton(), known);
  const testing::SyntheticClip clip =
      testing::MakeClip(MotionKind::kReach, 100, 30, {}, 1, performer);
  const PoseOptions options = testing::PlainOptions();
  const ClipEvidence evidence(DefaultSkeleton(), clip.camera, clip.detections.detections2d,
                              &clip.detections.detections3d, clip.fps, options);
  const FrameInitialization start = InitializeFrames(evidence);
  const CalibrationResult result = CalibrateProportions(evidence, start);
  for (int p = 0; p < kNumBodyParts; ++p) {
    EXPECT_NEAR(result.proportions.part[p], known.part[p], 0.02)
        << BodyPartName(static_cast<BodyPart>(p));
  }
  EXPECT_EQ(result.proportions.overall, 1);
}

TEST(CalibrationTest, NobodySeenIsTheRigItself) {
  const testing::SyntheticClip clip =
      testing::MakeClip(MotionKind::kWalk, 5, 30, {.gaps = {{0, 5}}}, 1);
  const PoseOptions options = testing::PlainOptions();
  const ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                              &clip.detections.detections3d, clip.fps, options);
  FrameInitialization start;
  start.poses = clip.poses;
  start.observed.assign(5, false);
  start.swaps.assign(5, SideSwap::kNone);
  start.observations.resize(5);
  const CalibrationResult result = CalibrateProportions(evidence, start);
  for (int p = 0; p < kNumBodyParts; ++p) {
    EXPECT_EQ(result.proportions.part[p], 1);
    EXPECT_GT(result.uncertainty.part[p], 0.02);
  }
}

}  // namespace
}  // namespace mpc
