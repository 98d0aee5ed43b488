// Whole clips: lengths, frame rates, threads, missing and wrong detections, bad input.
#include "mpc/pose/pose_estimator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "pose/synthetic_clip.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::VectorXd;
using testing::Estimate;
using testing::FrameErrors;
using testing::MakeClip;
using testing::PlainOptions;
using testing::SyntheticClip;

DetectionNoise LightNoise() { return DetectionNoise::White(2, 15, 0, 0); }

class ClipLengthTest : public ::testing::TestWithParam<int> {};

TEST_P(ClipLengthTest, IsTracked) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, GetParam(), 30, LightNoise(), 2);
  const PoseTrack track = Estimate(clip, PlainOptions());
  ASSERT_EQ(track.poses.cols(), GetParam());
  ASSERT_EQ(static_cast<int>(track.frames.size()), GetParam());
  EXPECT_EQ(track.num_windows, GetParam() > 100 ? 2 : 1);
  EXPECT_TRUE(track.poses.allFinite());
  EXPECT_LT(FrameErrors(clip, clip.skeleton, track.poses).mean(), 30);
  for (const FrameReport& frame : track.frames) {
    EXPECT_EQ(frame.state, TrackState::kTracked);
    EXPECT_TRUE(frame.used_3d);
    EXPECT_FALSE(frame.swapped_sides);
  }
}
INSTANTIATE_TEST_SUITE_P(Frames, ClipLengthTest, ::testing::Values(1, 2, 3, 49, 100, 101));

class FrameRateTest : public ::testing::TestWithParam<double> {};

TEST_P(FrameRateTest, IsTracked) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 25, GetParam(), LightNoise(), 2);
  const PoseTrack track = Estimate(clip, PlainOptions());
  EXPECT_TRUE(track.poses.allFinite());
  EXPECT_LT(FrameErrors(clip, clip.skeleton, track.poses).mean(), 30);
}
INSTANTIATE_TEST_SUITE_P(PerSecond, FrameRateTest, ::testing::Values(5, 30, 240));

TEST(PoseEstimatorTest, PaperPresetTracksToo) {
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, 60, 30, LightNoise(), 3);
  PoseOptions options = PoseOptions::Paper();
  options.num_threads = 1;
  const PoseTrack track = Estimate(clip, options);
  EXPECT_TRUE(track.poses.allFinite());
  EXPECT_LT(FrameErrors(clip, clip.skeleton, track.poses).mean(), 40);
}

TEST(PoseEstimatorTest, PosesStayInBounds) {
  const SyntheticClip clip =
      MakeClip(MotionKind::kReach, 60, 30, DetectionNoise::White(5, 60, 0.1, 0.2), 4);
  const PoseTrack track = Estimate(clip, PlainOptions());
  const VectorXd lower = clip.skeleton.LowerBounds();
  const VectorXd upper = clip.skeleton.UpperBounds();
  for (int f = 0; f < clip.num_frames(); ++f) {
    EXPECT_TRUE((track.poses.col(f).array() >= lower.array() - 1e-12).all()) << f;
    EXPECT_TRUE((track.poses.col(f).array() <= upper.array() + 1e-12).all()) << f;
  }
}

TEST(PoseEstimatorTest, TheNumberOfThreadsChangesNothing) {
  const SyntheticClip clip = MakeClip(MotionKind::kReach, 100, 30, LightNoise(), 5);
  PoseOptions options;
  options.window_frames = 50;
  options.overlap_frames = 10;
  options.num_threads = 1;
  const PoseTrack one = Estimate(clip, options);
  options.num_threads = 2;
  const PoseTrack two = Estimate(clip, options);
  ASSERT_GT(one.num_windows, 2);
  EXPECT_EQ(one.poses, two.poses);
  EXPECT_EQ(one.proportions.part, two.proportions.part);
}

TEST(PoseEstimatorTest, AGapOfASecondIsInterpolatedAndSaysSo) {
  DetectionNoise noise = LightNoise();
  noise.gaps = {{30, 60}};
  const SyntheticClip clip = MakeClip(MotionKind::kSquat, 90, 30, noise, 6);
  const PoseTrack track = Estimate(clip, PlainOptions());
  EXPECT_TRUE(track.poses.allFinite());
  for (int f = 0; f < 90; ++f) {
    const bool gap = f >= 30 && f < 60;
    EXPECT_EQ(track.frames[f].state, gap ? TrackState::kInterpolated : TrackState::kTracked) << f;
    if (!gap) continue;
    EXPECT_EQ(track.frames[f].confidence, 0);
    for (const JointReport& joint : track.frames[f].joints) {
      EXPECT_EQ(joint.state, TrackState::kInterpolated);
    }
    // Between its neighbours, not somewhere else.
    EXPECT_LT((track.poses.col(f) - track.poses.col(29)).head<3>().norm(), 1);
  }
  for (int f = 1; f < 90; ++f) {
    const VectorXd step = track.poses.col(f) - track.poses.col(f - 1);
    EXPECT_LT(step.tail(27).cwiseAbs().maxCoeff(), 0.5) << f;
  }
}

TEST(PoseEstimatorTest, APersonLeavingThePictureIsTrackedBeforeAndAfter) {
  SyntheticClip clip = MakeClip(MotionKind::kWalk, 80, 30, {}, 7);
  for (int f = 0; f < 80; ++f) clip.poses(0, f) += std::max(0.0, 4.0 - std::abs(f - 40) * 0.2);
  clip.detections =
      SynthesizeDetections(clip.skeleton, clip.poses, clip.camera, 30, LightNoise(), 7);
  ASSERT_EQ(clip.detections.detections2d.frames[40].confidence.maxCoeff(), 0);
  const PoseTrack track = Estimate(clip, PlainOptions());
  EXPECT_TRUE(track.poses.allFinite());
  EXPECT_EQ(track.frames[40].state, TrackState::kInterpolated);
  const VectorXd errors = FrameErrors(clip, clip.skeleton, track.poses);
  EXPECT_LT(errors.head(15).mean(), 30);
  EXPECT_LT(errors.tail(15).mean(), 30);
}

TEST(PoseEstimatorTest, SwappedSidesAreFlaggedAndRepaired) {
  DetectionNoise noise = LightNoise();
  const SyntheticClip straight = MakeClip(MotionKind::kWalk, 60, 30, noise, 8);
  noise.swapped_fraction = 0.1;
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 60, 30, noise, 8);
  const PoseTrack track = Estimate(clip, PlainOptions());
  int num_swapped = 0;
  for (int f = 0; f < 60; ++f) {
    const bool swapped = clip.detections.detections2d.frames[f].pixels !=
                         straight.detections.detections2d.frames[f].pixels;
    EXPECT_EQ(track.frames[f].swapped_sides, swapped) << f;
    num_swapped += swapped ? 1 : 0;
  }
  ASSERT_GT(num_swapped, 2);
  const PoseTrack reference = Estimate(straight, PlainOptions());
  EXPECT_LT(FrameErrors(clip, clip.skeleton, track.poses).mean(),
            1.1 * FrameErrors(straight, clip.skeleton, reference.poses).mean());
}

TEST(PoseEstimatorTest, WorksWithout3d) {
  const SyntheticClip clip =
      MakeClip(MotionKind::kWalk, 50, 30, DetectionNoise::White(1, 0, 0, 0), 9);
  const PoseTrack track = EstimatePoses(clip.skeleton, clip.camera, clip.detections.detections2d,
                                        nullptr, 30, PlainOptions());
  EXPECT_TRUE(track.poses.allFinite());
  for (const FrameReport& frame : track.frames) {
    EXPECT_FALSE(frame.used_3d);
    EXPECT_LT(frame.residual_px, 15);
  }
}

TEST(PoseEstimatorTest, TheCallbackCanStopInEveryStage) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 130, 30, LightNoise(), 10);
  PoseOptions options = PlainOptions();
  options.fit_proportions = true;
  for (const char* stage : {"start", "proportions", "pose"}) {
    int calls = 0;
    const PoseTrack track = EstimatePoses(clip.skeleton, clip.camera, clip.detections.detections2d,
                                          &clip.detections.detections3d, 30, options, {},
                                          [&](const Progress& progress) {
                                            calls += progress.stage == stage ? 1 : 0;
                                            return calls < 2;
                                          });
    EXPECT_TRUE(track.cancelled) << stage;
    EXPECT_EQ(calls, 2) << stage;
    EXPECT_TRUE(track.poses.allFinite()) << stage;
    EXPECT_EQ(track.frames.size(), 130u) << stage;
  }
}

TEST(PoseEstimatorTest, ProgressCountsEveryStageToItsEnd) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 60, 30, LightNoise(), 10);
  PoseOptions options = PlainOptions();
  options.fit_proportions = true;
  std::map<std::string, Progress> last;
  EstimatePoses(clip.skeleton, clip.camera, clip.detections.detections2d,
                &clip.detections.detections3d, 30, options, {}, [&](const Progress& progress) {
                  Progress& before = last[std::string(progress.stage)];
                  EXPECT_GE(progress.step, before.step) << progress.stage;
                  before = progress;
                  return true;
                });
  EXPECT_EQ(last.size(), 3u);
  for (const char* stage : {"start", "proportions", "pose"}) {
    EXPECT_GT(last[stage].step, 0) << stage;
    EXPECT_EQ(last[stage].step, last[stage].num_steps) << stage;
  }
}

TEST(PoseEstimatorTest, NobodySeenIsAnError) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 20, 30, {.gaps = {{0, 20}}}, 1);
  EXPECT_MPC_ERROR(Estimate(clip, PlainOptions()), kMismatch, "2D detections of a person");
}

TEST(PoseEstimatorTest, BadInputIsAnError) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 4, 30, {}, 1);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  {
    SyntheticClip bad = clip;
    bad.detections.detections2d.frames[2].pixels(1, 3) = nan;
    EXPECT_MPC_ERROR(Estimate(bad, PlainOptions()), kInvalidArgument, "");
  }
  {
    SyntheticClip bad = clip;
    bad.detections.detections3d.frames[2].positions(1, 3) = nan;
    EXPECT_MPC_ERROR(Estimate(bad, PlainOptions()), kInvalidArgument, "");
  }
  {
    SyntheticClip bad = clip;
    bad.detections.detections3d.frames.pop_back();
    EXPECT_MPC_ERROR(Estimate(bad, PlainOptions()), kMismatch, "3");
  }
  {
    SyntheticClip bad = clip;
    bad.detections.detections2d.frames.clear();
    EXPECT_MPC_ERROR(Estimate(bad, PlainOptions()), kMismatch, "no frames");
  }
  {
    SyntheticClip bad = clip;
    bad.camera.fx = -1;
    EXPECT_MPC_ERROR(Estimate(bad, PlainOptions()), kInvalidArgument, "");
  }
  for (const double fps : {0.0, -30.0, nan}) {
    SyntheticClip bad = clip;
    bad.fps = fps;
    EXPECT_MPC_ERROR(Estimate(bad, PlainOptions()), kInvalidArgument, "frame rate");
  }
  PoseOptions options = PlainOptions();
  options.weight_smooth = nan;
  EXPECT_MPC_ERROR(Estimate(clip, options), kInvalidArgument, "weight_smooth");
}

}  // namespace
}  // namespace mpc
