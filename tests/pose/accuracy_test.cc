// Accuracy on performances with known truth, over motions and dice. Default settings throughout.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "mpc/pose/frame_initializer.h"
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
};

Outcome RunClips(MotionKind motion, const DetectionNoise& noise) {
  Outcome outcome;
  constexpr int kSeeds = 3;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const SyntheticClip clip = MakeClip(motion, kFrames, kFps, noise, seed);
    const PoseOptions options = testing::PlainOptions();
    const ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                                &clip.detections.detections3d, kFps, options);
    const auto error = [&](const Eigen::MatrixXd& poses) {
      return FrameErrors(clip, clip.skeleton, poses).mean() / kSeeds;
    };
    outcome.per_frame_mm += error(InitializeFrames(evidence).poses);
    outcome.batch_mm += error(testing::Estimate(clip, options).poses);
  }
  return outcome;
}

// The goals: 20 mm with white noise and 50 mm with errors of the measured kind. The squat reaches 19.9;
// its bound leaves room for another machine's last bits.
struct Bounds {
  MotionKind motion;
  double white_mm;
  double measured_mm;
};

class AccuracyTest : public ::testing::TestWithParam<Bounds> {
 protected:
  void Check(const DetectionNoise& noise, double bound_mm) {
    const Outcome outcome = RunClips(GetParam().motion, noise);
    std::printf("%s: %.1f mm per frame, %.1f mm batch (bound %.0f)\n",
                std::string(MotionName(GetParam().motion)).c_str(), outcome.per_frame_mm,
                outcome.batch_mm, bound_mm);
    EXPECT_LE(outcome.batch_mm, bound_mm);
    EXPECT_LE(outcome.batch_mm, outcome.per_frame_mm);
  }
};

TEST_P(AccuracyTest, WhiteNoise) {
  Check(DetectionNoise::White(5, 60, 0.1, 0.2), GetParam().white_mm);
}

TEST_P(AccuracyTest, MeasuredErrors) { Check(DetectionNoise::Measured(), GetParam().measured_mm); }

// The third frame after a second in which nothing was seen, beside the same frame of the same dice
// without the gap. Estimates draw on the frames around them, of which half are missing there, so white
// noise averages out less: by up to the square root of two. Without noise nothing of the gap is left.
double ThirdVisibleFrame(const DetectionNoise& visible, bool gap) {
  double error = 0;
  constexpr int kSeeds = 10;
  for (const MotionKind motion : {MotionKind::kWalk, MotionKind::kReach}) {
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
      DetectionNoise noise = visible;
      if (gap) noise.gaps = {{25, 55}};
      const SyntheticClip clip = MakeClip(motion, 75, kFps, noise, seed);
      const PoseTrack track = testing::Estimate(clip, testing::PlainOptions());
      error += FrameErrors(clip, clip.skeleton, track.poses)[57] / (2 * kSeeds);
    }
  }
  return error;
}

TEST(OcclusionTest, ErrorsAreBackByTheThirdVisibleFrame) {
  const double exact_whole = ThirdVisibleFrame({}, false);
  const double exact = ThirdVisibleFrame({}, true);
  const double noisy_whole = ThirdVisibleFrame(DetectionNoise::White(5, 30, 0, 0), false);
  const double noisy = ThirdVisibleFrame(DetectionNoise::White(5, 30, 0, 0), true);
  std::printf("third visible frame: %.1f mm, without the gap %.1f mm; exact %.1f and %.1f mm\n",
              noisy, noisy_whole, exact, exact_whole);
  EXPECT_LE(exact, 1.1 * exact_whole);
  EXPECT_LE(noisy, std::sqrt(2.0) * noisy_whole);
}

INSTANTIATE_TEST_SUITE_P(
    Motions, AccuracyTest,
    ::testing::Values(Bounds{MotionKind::kWalk, 20, 50}, Bounds{MotionKind::kSquat, 21, 50},
                      Bounds{MotionKind::kTurn, 20, 50}, Bounds{MotionKind::kReach, 20, 50},
                      Bounds{MotionKind::kRoll, 20, 50}),
    [](const auto& test) { return std::string(MotionName(test.param.motion)); });

}  // namespace
}  // namespace mpc
