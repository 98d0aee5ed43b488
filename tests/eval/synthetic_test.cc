#include "mpc/eval/synthetic.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/eval/motions.h"

namespace mpc {
namespace {

class SyntheticTest : public ::testing::Test {
 protected:
  SyntheticTest() {
    camera_ = Camera::FromFov(1920, 1080, 1.0);
    // World y up to camera y down, 4 m away.
    const Eigen::Matrix3d flip = ExpSO3({std::numbers::pi, 0, 0});
    poses_ = TransformPoses(flip, {0.8, 1, 4}, MakeMotion(skeleton_, MotionKind::kReach, 20, kFps));
    perfect_ = Make({});
  }
  SyntheticDetections Make(const DetectionNoise& noise, uint64_t seed = 3) const {
    return SynthesizeDetections(skeleton_, poses_, camera_, kFps, noise, seed);
  }
  // 3D error of a frame in the ray frame, 3x16, m.
  Eigen::Matrix3Xd Error3d(const SyntheticDetections& noisy, int frame) const {
    return noisy.detections3d.frames[frame].positions -
           perfect_.detections3d.frames[frame].positions;
  }
  static constexpr double kFps = 30;
  Skeleton skeleton_ = DefaultSkeleton();
  Camera camera_;
  Eigen::MatrixXd poses_;
  SyntheticDetections perfect_;
};

TEST_F(SyntheticTest, WithoutNoiseDetectionsAreTheTruth) {
  const SyntheticDetections perfect = PerfectDetections(skeleton_, poses_, camera_, kFps);
  perfect.detections2d.Validate();
  perfect.detections3d.Validate();
  ASSERT_EQ(perfect.detections2d.frames.size(), 600u);
  ASSERT_EQ(perfect.joints.size(), 16u);
  for (int f : {0, 17, 599}) {
    const Eigen::Matrix3Xd truth = perfect.truth.col(f).reshaped(3, 16);
    const Eigen::Vector3d hips = 0.5 * (truth.col(static_cast<int>(JointId::kLeftHip)) +
                                        truth.col(static_cast<int>(JointId::kRightHip)));
    const Eigen::Matrix3d camera_from_ray = CameraFromRay(hips);
    const Eigen::Matrix3Xd seen = camera_from_ray * perfect.detections3d.frames[f].positions;
    for (int j = 0; j < 16; ++j) {
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(camera_, truth.col(j), &pixel));
      EXPECT_EQ(pixel, perfect_.detections2d.frames[f].pixels.col(j));
      EXPECT_GT(perfect.detections2d.frames[f].confidence[j], 0);
      EXPECT_LT((seen.col(j) - seen.col(0) - truth.col(j) + truth.col(0)).norm(), 1e-12);
    }
  }
}

TEST_F(SyntheticTest, SameSeedSameBytes) {
  DetectionNoise noise = DetectionNoise::Measured();
  noise.outlier_fraction = noise.dropped_fraction = noise.swapped_fraction = 0.1;
  const SyntheticDetections a = Make(noise, 5);
  const SyntheticDetections b = Make(noise, 5);
  const SyntheticDetections c = Make(noise, 6);
  bool differs = false;
  for (size_t f = 0; f < a.detections2d.frames.size(); ++f) {
    EXPECT_EQ(a.detections2d.frames[f].pixels, b.detections2d.frames[f].pixels);
    EXPECT_EQ(a.detections3d.frames[f].positions, b.detections3d.frames[f].positions);
    EXPECT_EQ(a.detections3d.frames[f].confidence, b.detections3d.frames[f].confidence);
    differs |= a.detections3d.frames[f].positions != c.detections3d.frames[f].positions;
  }
  EXPECT_TRUE(differs);
}

TEST_F(SyntheticTest, WhiteNoiseHasTheSizeAskedFor) {
  const SyntheticDetections noisy = Make(DetectionNoise::White(5, 60, 0, 0.2));
  double sum2d = 0, sum3d = 0, dropped = 0;
  for (int f = 0; f < 600; ++f) {
    sum2d += (noisy.detections2d.frames[f].pixels - perfect_.detections2d.frames[f].pixels)
                 .squaredNorm();
    sum3d += Error3d(noisy, f).squaredNorm();
    const Eigen::VectorXd& confidence = noisy.detections3d.frames[f].confidence;
    dropped += static_cast<double>((confidence.array() == 0).count());
    EXPECT_TRUE(
        ((confidence.array() == 0) == (noisy.detections2d.frames[f].confidence.array() == 0))
            .all());
  }
  EXPECT_NEAR(std::sqrt(sum2d / (600 * 16 * 2)), 5, 0.1);
  EXPECT_NEAR(std::sqrt(sum3d / (600 * 16 * 3)), 0.060, 0.001);
  EXPECT_NEAR(dropped / (600 * 16), 0.2, 0.015);
}

TEST_F(SyntheticTest, OutliersAreAsManyAsAskedFor) {
  const SyntheticDetections noisy = Make(DetectionNoise::White(0, 0, 0.1, 0));
  double outliers2d = 0, outliers3d = 0;
  for (int f = 0; f < 600; ++f) {
    outliers2d += static_cast<double>(
        ((noisy.detections2d.frames[f].pixels - perfect_.detections2d.frames[f].pixels)
             .colwise()
             .norm()
             .array() > 1)
            .count());
    outliers3d += static_cast<double>((Error3d(noisy, f).colwise().norm().array() > 1e-3).count());
  }
  EXPECT_NEAR(outliers2d / 9600, 0.1, 0.01);
  EXPECT_NEAR(outliers3d / 9600, 0.1, 0.01);
}

TEST_F(SyntheticTest, BiasHasItsSizeAndLastsAsLongAsAsked) {
  DetectionNoise noise;
  noise.bias_along_ray_mm = 90;
  noise.bias_across_ray_mm = 45;
  const double correlation_s = noise.bias_correlation_s;
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  double lagged = 0;
  double steps = 0;
  const int lag = static_cast<int>(0.5 * correlation_s * kFps);
  const int num_seeds = 8;
  for (int seed = 0; seed < num_seeds; ++seed) {
    const SyntheticDetections noisy = Make(noise, seed);
    std::vector<Eigen::Matrix3Xd> errors;
    for (int f = 0; f < 600; ++f) errors.push_back(Error3d(noisy, f));
    for (int f = 0; f + lag < 600; ++f) {
      squares += errors[f].rowwise().squaredNorm();
      lagged += errors[f].row(2).dot(errors[f + lag].row(2));
      steps += (errors[f + 1] - errors[f]).row(2).squaredNorm();
    }
  }
  const double count = num_seeds * (600 - lag) * 16;
  EXPECT_NEAR(std::sqrt(squares[2] / count), 0.090, 0.006);
  EXPECT_NEAR(std::sqrt((squares[0] + squares[1]) / count), 0.045, 0.003);
  EXPECT_NEAR(lagged / squares[2], 2 / std::exp(1.0), 0.05);  // (1 + t/a) exp(-t/a) at t = a
  EXPECT_LT(std::sqrt(steps / count), 0.008);                 // a bias, not noise
}

TEST_F(SyntheticTest, ReversedLimbsKeepTheirPictureAndBoneLengths) {
  DetectionNoise noise;
  noise.reversed_fraction = 0.5;
  const SyntheticDetections noisy = Make(noise);
  int reversed = 0;
  int longest = 0;
  int run = 0;
  for (int f = 0; f < 600; ++f) {
    const Eigen::Matrix3Xd error = Error3d(noisy, f);
    EXPECT_LT(error.topRows<2>().cwiseAbs().maxCoeff(), 1e-12);
    run = error.cwiseAbs().maxCoeff() > 1e-9 ? run + 1 : 0;
    reversed += run > 0 ? 1 : 0;
    longest = std::max(longest, run);
    const Eigen::Matrix3Xd& x = noisy.detections3d.frames[f].positions;
    const auto elbow = static_cast<int>(JointId::kLeftElbow);
    const auto wrist = static_cast<int>(JointId::kLeftWrist);
    EXPECT_NEAR((x.col(elbow) - x.col(wrist)).norm(), 0.146 * 1.75, 1e-9);
  }
  EXPECT_NEAR(reversed / 600.0, 0.5, 0.15);
  EXPECT_LE(longest, 2 * 31);  // two episodes may touch
  EXPECT_GE(longest, 9);
}

TEST_F(SyntheticTest, GapsAndSwaps) {
  DetectionNoise noise;
  noise.gaps = {{10, 20}, {590, 700}};
  noise.swapped_fraction = 1;
  const SyntheticDetections noisy = Make(noise);
  for (int f = 0; f < 600; ++f) {
    const bool gap = (f >= 10 && f < 20) || f >= 590;
    EXPECT_EQ(noisy.detections2d.frames[f].confidence.isZero(), gap);
    EXPECT_EQ(noisy.detections3d.frames[f].confidence.isZero(), gap);
    EXPECT_EQ(noisy.detections2d.frames[f].pixels.col(static_cast<int>(JointId::kLeftToe)),
              perfect_.detections2d.frames[f].pixels.col(static_cast<int>(JointId::kRightToe)));
    EXPECT_EQ(noisy.detections2d.frames[f].pixels.col(static_cast<int>(JointId::kNeck)),
              perfect_.detections2d.frames[f].pixels.col(static_cast<int>(JointId::kNeck)));
  }
}

TEST_F(SyntheticTest, JointsOutsideThePictureAreNotSeenIn2d) {
  const Eigen::MatrixXd behind =
      TransformPoses(Eigen::Matrix3d::Identity(), {0, 0, -20}, poses_.leftCols(3));
  const Eigen::MatrixXd aside =
      TransformPoses(Eigen::Matrix3d::Identity(), {50, 0, 0}, poses_.leftCols(3));
  for (const Eigen::MatrixXd& poses : {behind, aside}) {
    const SyntheticDetections unseen = PerfectDetections(skeleton_, poses, camera_, kFps);
    unseen.detections2d.Validate();
    EXPECT_TRUE(unseen.detections2d.frames[0].confidence.isZero());
    EXPECT_FALSE(unseen.detections3d.frames[0].confidence.isZero());
  }
}

TEST_F(SyntheticTest, UnusableInputIsRefused) {
  DetectionNoise noise;
  noise.sigma_mm = std::nan("");
  noise.dropped_fraction = 2;
  EXPECT_THROW(Make(noise), Error);
  EXPECT_THROW(SynthesizeDetections(skeleton_, poses_.topRows(20), camera_, kFps, {}, 0), Error);
  EXPECT_THROW(SynthesizeDetections(skeleton_, poses_, camera_, 0, {}, 0), Error);
}

TEST_F(SyntheticTest, FailuresComeOnTopOfTheMeasuredErrors) {
  // The dice are the same, so that everything else is equal.
  const SyntheticDetections usual = Make(DetectionNoise::Measured());
  const SyntheticDetections failing = Make(DetectionNoise::MeasuredWithFailures());
  const auto left = static_cast<int>(JointId::kLeftWrist);
  const auto right = static_cast<int>(JointId::kRightWrist);
  double swapped = 0, dropped = 0, wrong = 0;
  for (int f = 0; f < 600; ++f) {
    const Detections2d::Frame& before = usual.detections2d.frames[f];
    const Detections2d::Frame& after = failing.detections2d.frames[f];
    const bool exchanged = (after.pixels.col(left) - before.pixels.col(right)).norm() < 1e-9 ||
                           (after.pixels.col(right) - before.pixels.col(left)).norm() < 1e-9;
    swapped += exchanged;
    dropped += static_cast<double>((after.confidence.array() == 0).count()) / 16;
    if (exchanged) continue;
    wrong += static_cast<double>(
                 ((after.pixels - before.pixels).colwise().norm().array() > 1e-9).count()) /
             16;
  }
  EXPECT_NEAR(swapped / 600, 0.02, 0.012);
  EXPECT_NEAR(dropped / 600, 0.03, 0.01);
  EXPECT_NEAR(wrong / 600, 0.01, 0.005);
}

}  // namespace
}  // namespace mpc
