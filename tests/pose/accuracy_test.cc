// Accuracy on performances with known truth, over motions and dice. Default settings throughout.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "mpc/pose/frame_initializer.h"
#include "mpc/skeleton/proportions.h"
#include "pose/synthetic_clip.h"

namespace mpc {
namespace {

using testing::FrameErrors;
using testing::MakeClip;
using testing::SyntheticClip;

constexpr double kFps = 30;
constexpr int kFrames = 150;

struct Outcome {
  double per_frame_mm = 0;
  double batch_mm = 0;
  double fitted_mm = 0;  // default settings: proportions fitted, though the rig's are right already
};

Outcome RunClips(MotionKind motion, const DetectionNoise& noise) {
  Outcome outcome;
  constexpr int kSeeds = 3;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const SyntheticClip clip = MakeClip(motion, kFrames, kFps, noise, seed);
    PoseOptions options = testing::PlainOptions();
    const ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                                &clip.detections.detections3d, kFps, options);
    const auto error = [&](const Skeleton& skeleton, const Eigen::MatrixXd& poses) {
      return FrameErrors(clip, skeleton, poses).mean();
    };
    const double per_frame = error(clip.skeleton, InitializeFrames(evidence).poses);
    const double batch = error(clip.skeleton, testing::Estimate(clip, options).poses);
    options.fit_proportions = true;
    const PoseTrack track = testing::Estimate(clip, options);
    const double fitted = error(ScaledSkeleton(clip.skeleton, track.proportions), track.poses);
    EXPECT_LE(batch, per_frame) << "seed " << seed;
    EXPECT_LE(fitted, per_frame) << "seed " << seed;
    outcome.per_frame_mm += per_frame / kSeeds;
    outcome.batch_mm += batch / kSeeds;
    outcome.fitted_mm += fitted / kSeeds;
  }
  return outcome;
}

// The goals: 20 mm with white noise and 50 mm with errors of the measured kind, with the right
// proportions and with fitted ones.
constexpr double kWhiteGoalMm = 20;
constexpr double kMeasuredGoalMm = 50;

class AccuracyTest : public ::testing::TestWithParam<MotionKind> {
 protected:
  void Check(const DetectionNoise& noise, double goal_mm) {
    const Outcome outcome = RunClips(GetParam(), noise);
    std::printf("%s: %.1f mm per frame, %.1f batch, %.1f fitted (goal %.0f)\n",
                std::string(MotionName(GetParam())).c_str(), outcome.per_frame_mm, outcome.batch_mm,
                outcome.fitted_mm, goal_mm);
    EXPECT_LE(outcome.batch_mm, goal_mm);
    EXPECT_LE(outcome.fitted_mm, goal_mm);
  }
};

TEST_P(AccuracyTest, WhiteNoise) { Check(DetectionNoise::White(5, 60, 0.1, 0.2), kWhiteGoalMm); }

TEST_P(AccuracyTest, MeasuredErrors) { Check(DetectionNoise::Measured(), kMeasuredGoalMm); }

INSTANTIATE_TEST_SUITE_P(Motions, AccuracyTest,
                         ::testing::Values(MotionKind::kWalk, MotionKind::kSquat, MotionKind::kTurn,
                                           MotionKind::kReach, MotionKind::kRoll),
                         [](const auto& test) { return std::string(MotionName(test.param)); });

}  // namespace
}  // namespace mpc
