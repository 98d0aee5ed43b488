// The focal length of an unknown camera, on made-up clips whose camera is known.
#include "mpc/pose/focal_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mpc/core/rigid.h"
#include "pose/synthetic_clip.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using testing::PlainOptions;
using testing::SyntheticClip;

constexpr double kFps = 10;

// A person who fills 70 % of the picture's height, whatever the field of view: what changes is how
// near the camera is. Seen from a little above.
SyntheticClip ClipOf(double fov_deg, MotionKind kind, const DetectionNoise& noise, uint64_t seed) {
  SyntheticClip clip;
  clip.fps = kFps;
  clip.camera = Camera::FromFov(1920, 1080, fov_deg * std::numbers::pi / 180);
  const double distance = 1.75 * clip.camera.fy / (0.7 * 1080);
  const Eigen::Matrix3d down =
      ExpSO3({std::atan(0.6 / distance), 0, 0}) * Eigen::Vector3d(1, -1, -1).asDiagonal();
  const Eigen::MatrixXd motion = MakeMotion(clip.skeleton, kind, 3, kFps);
  const Eigen::Vector3d middle = motion.topRows(3).rowwise().mean();
  const Eigen::Vector3d center(middle.x(), 1.5, middle.z() + distance);
  clip.poses = TransformPoses(down, -(down * center), motion);
  clip.detections = SynthesizeDetections(clip.skeleton, clip.poses, clip.camera, kFps, noise, seed);
  return clip;
}

FocalEstimate Estimate(const SyntheticClip& clip, const FocalPrior& prior,
                       const ProgressCallback& progress = {}) {
  return EstimateFocal(clip.skeleton, clip.camera.width, clip.camera.height,
                       clip.detections.detections2d, &clip.detections.detections3d, kFps,
                       PlainOptions(), prior, progress);
}

const FocalPrior kUsual = FocalPrior::Usual(1920, 1080);

double LogError(const FocalEstimate& estimate, const SyntheticClip& clip) {
  return std::log(estimate.focal_px / clip.camera.fx);
}

TEST(EstimateFocal, IsFoundFromExactDetections) {
  for (const double fov_deg : {45.0, 75.0}) {
    const SyntheticClip clip = ClipOf(fov_deg, MotionKind::kWalk, {}, 1);
    const FocalEstimate estimate = Estimate(clip, kUsual);
    EXPECT_NEAR(LogError(estimate, clip), 0, 0.15) << fov_deg;
    EXPECT_LT(estimate.relative_sigma, 0.2) << fov_deg;
  }
}

// With a network's errors the person says little: the uncertainty must say so, and at the usual field
// of view the estimate stays near.
TEST(EstimateFocal, KnowsItsUncertaintyUnderANetworksErrors) {
  double squares = 0;
  int count = 0;
  for (const MotionKind kind : {MotionKind::kWalk, MotionKind::kSquat}) {
    for (const double fov_deg : {45.0, 60.0, 75.0}) {
      const SyntheticClip clip = ClipOf(fov_deg, kind, DetectionNoise::Measured(), 2);
      const FocalEstimate estimate = Estimate(clip, kUsual);
      const double error = LogError(estimate, clip);
      std::printf("%s, %.0f degrees: focal length off by %+.0f %%, said %.0f %%\n",
                  std::string(MotionName(kind)).c_str(), fov_deg, 100 * std::expm1(error),
                  100 * estimate.relative_sigma);
      EXPECT_LE(estimate.relative_sigma, kUsual.relative_sigma);
      EXPECT_LT(std::abs(error), 3 * estimate.relative_sigma);
      if (fov_deg == 60) {
        EXPECT_LT(std::abs(error), 0.2);
      }
      squares += std::pow(error / estimate.relative_sigma, 2);
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(squares / count), 1.5);
}

TEST(EstimateFocal, AStatedFocalLengthDecides) {
  const SyntheticClip clip = ClipOf(75, MotionKind::kSquat, DetectionNoise::Measured(), 3);
  const FocalPrior stated = {.focal_px = 1.05 * clip.camera.fx, .relative_sigma = 0.05};
  const FocalEstimate estimate = Estimate(clip, stated);
  EXPECT_NEAR(std::log(estimate.focal_px / stated.focal_px), 0, 0.08);
  EXPECT_LE(estimate.relative_sigma, 0.05);
}

TEST(EstimateFocal, EndsWhenItIsToldTo) {
  const SyntheticClip clip = ClipOf(60, MotionKind::kSquat, {}, 1);
  int num_calls = 0;
  const FocalEstimate estimate = Estimate(clip, kUsual, [&](const Progress& step) {
    EXPECT_EQ(step.stage, "focal");
    return ++num_calls < 2;
  });
  EXPECT_EQ(num_calls, 2);
  EXPECT_EQ(estimate.focal_px, kUsual.focal_px);  // two values show no minimum: the prior
  EXPECT_EQ(estimate.relative_sigma, kUsual.relative_sigma);
}

TEST(EstimateFocal, RefusesAPriorThatIsNone) {
  const SyntheticClip clip = ClipOf(60, MotionKind::kSquat, {}, 1);
  for (const FocalPrior prior : {FocalPrior{0, 0.3}, {1000, 0}, {1000, 2}, {std::nan(""), 0.3}}) {
    EXPECT_MPC_ERROR(static_cast<void>(Estimate(clip, prior)), kInvalidArgument, "focal length of");
  }
}

}  // namespace
}  // namespace mpc
