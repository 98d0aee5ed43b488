#include "mpc/seg/background_plate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/seg/silhouette.h"
#include "simulated_masks.h"
#include "support/expect_error.h"
#include "test_scene.h"

namespace mpc {
namespace {

using mpc::testing::MakeScene;
using mpc::testing::MaskIou;
using mpc::testing::TestScene;
using mpc::testing::TestSceneOptions;
using mpc::testing::WrongModel;

constexpr int kSamples = 9;

// A figure walks through the picture from side to side.
std::vector<PlateSample> Walk(TestSceneOptions options = {}, double model_shift = 0) {
  std::vector<PlateSample> samples;
  for (int i = 0; i < kSamples; ++i) {
    options.centre.x = -60 + 45 * i;
    options.seed = static_cast<uint32_t>(i + 1);
    samples.push_back({MakeScene(options).picture, WrongModel(options, model_shift)});
  }
  return samples;
}

cv::Mat EmptyScene(TestSceneOptions options = {}) {
  options.centre = {-1000, -1000};
  return MakeScene(options).picture;
}

double MeanDifference(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference, mask);
  return (mean[0] + mean[1] + mean[2]) / 3;
}

TEST(BackgroundPlate, IsWhatTheActorHides) {
  const BackgroundPlate plate = MakeBackgroundPlate(Walk());
  const cv::Mat known = plate.spread != BackgroundPlate::kUnknown;
  EXPECT_EQ(cv::countNonZero(~known), 0);
  // Noise of 3 steps in each: of a median of nine far less is left.
  EXPECT_LT(MeanDifference(plate.picture, EmptyScene(), known), 3.2);
  EXPECT_NEAR(cv::mean(plate.spread)[0], 3, 1.5);
}

TEST(BackgroundPlate, IsTheMedianOfEveryPixel) {
  cv::RNG rng(5);
  for (const int count : {3, 4, 24}) {
    std::vector<PlateSample> samples;
    for (int i = 0; i < count; ++i) {
      cv::Mat picture(7, 33, CV_8UC3);
      rng.fill(picture, cv::RNG::UNIFORM, 0, 256);
      samples.push_back({picture, cv::Mat(picture.size(), CV_8U, cv::Scalar(0))});
    }
    const BackgroundPlate plate = MakeBackgroundPlate(samples);
    const auto median = [](std::vector<int> values) {
      std::sort(values.begin(), values.end());
      return values[values.size() / 2];
    };
    for (int i = 0; i < 7 * 33; ++i) {
      const cv::Point at(i % 33, i / 33);
      int spread = 0;
      for (int c = 0; c < 3; ++c) {
        std::vector<int> values;
        for (const PlateSample& sample : samples) {
          values.push_back(sample.picture.at<cv::Vec3b>(at)[c]);
        }
        const int middle = median(values);
        EXPECT_EQ(plate.picture.at<cv::Vec3b>(at)[c], middle) << count << " samples";
        for (int& value : values) value = std::abs(value - middle);
        spread = std::max(spread, median(values));
      }
      EXPECT_EQ(plate.spread.at<uint8_t>(at), std::min(static_cast<int>(1.4826 * spread), 254));
    }
  }
}

TEST(BackgroundPlate, IsUnknownWhereTheActorAlwaysIs) {
  const TestSceneOptions options;
  const TestScene scene = MakeScene(options);
  const std::vector<PlateSample> samples(kSamples, {scene.picture, scene.truth});
  const BackgroundPlate plate = MakeBackgroundPlate(samples);
  EXPECT_EQ(cv::countNonZero((plate.spread != BackgroundPlate::kUnknown) & scene.truth), 0);
  EXPECT_EQ(plate.spread.at<uint8_t>(5, 5), 0);
}

TEST(BackgroundPlate, ForgetsWhoPassesBy) {
  std::vector<PlateSample> samples = Walk();
  for (const size_t i : {3U, 4U}) {
    cv::rectangle(samples[i].picture, {10, 10, 200, 60}, {0, 255, 0}, cv::FILLED);
  }
  const BackgroundPlate plate = MakeBackgroundPlate(samples);
  EXPECT_LT(MeanDifference(plate.picture, EmptyScene(), cv::Mat()), 3.2);
}

TEST(BackgroundPlate, KnowsThatItDoesNotKnowAMovingScene) {
  std::vector<PlateSample> samples;
  TestSceneOptions options;
  for (int i = 0; i < kSamples; ++i) {
    options.camera = {13.0 * i, -9.0 * i};
    samples.push_back({MakeScene(options).picture, cv::Mat(options.size, CV_8U, cv::Scalar(0))});
  }
  EXPECT_GT(cv::mean(MakeBackgroundPlate(samples).spread)[0], 9);
}

// A camera that moves by known ways, and an actor who goes with it.
std::vector<PlateSample> Pan() {
  std::vector<PlateSample> samples;
  TestSceneOptions options;
  for (int i = 0; i < kSamples; ++i) {
    options.camera = {15.0 * i - 60, 5.0 * i - 20};
    options.seed = static_cast<uint32_t>(i + 1);
    const cv::Matx33d place(1, 0, 100 - options.camera.x, 0, 1, 40 - options.camera.y, 0, 0, 1);
    samples.push_back({MakeScene(options).picture, WrongModel(options, 0), place});
  }
  return samples;
}

TEST(BackgroundPlate, HoldsWhatATurningCameraHasSeen) {
  const TestSceneOptions options;
  const cv::Size size = options.size + cv::Size(200, 80);
  const BackgroundPlate plate = MakeBackgroundPlate(Pan(), 2, size);
  ASSERT_EQ(plate.picture.size(), size);
  const cv::Matx33d place(1, 0, 100, 0, 1, 40, 0, 0, 1);
  const BackgroundPlate view = ViewOfPlate(plate, place, options.size);
  const cv::Mat known = view.spread != BackgroundPlate::kUnknown;
  EXPECT_GT(cv::countNonZero(known), 0.85 * static_cast<double>(known.total()));
  EXPECT_LT(MeanDifference(view.picture, EmptyScene(), known), 3.2);
  // Taken for a camera at rest it is a blur.
  EXPECT_LT(cv::mean(view.spread, known)[0], 6);
  // Never seen: above the first picture and left of it.
  EXPECT_EQ(plate.spread.at<uint8_t>(2, 150), BackgroundPlate::kUnknown);
  const BackgroundPlate aside = ViewOfPlate(plate, cv::Matx33d::eye(), options.size);
  EXPECT_EQ(aside.spread.at<uint8_t>(100, 2), BackgroundPlate::kUnknown);
}

TEST(BackgroundPlate, SameForAnyNumberOfThreads) {
  const BackgroundPlate one = MakeBackgroundPlate(Walk(), 1);
  const BackgroundPlate three = MakeBackgroundPlate(Walk(), 3);
  EXPECT_EQ(cv::norm(one.picture, three.picture, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(one.spread, three.spread, cv::NORM_INF), 0);
  const BackgroundPlate turning = MakeBackgroundPlate(Pan(), 1, {400, 380});
  EXPECT_EQ(
      cv::norm(turning.picture, MakeBackgroundPlate(Pan(), 3, {400, 380}).picture, cv::NORM_INF),
      0);
}

TEST(BackgroundPlate, RefusesWhatDoesNotFit) {
  EXPECT_MPC_ERROR(MakeBackgroundPlate({}), kInvalidArgument, "no samples");
  std::vector<PlateSample> samples = Walk();
  samples[2].model_mask = cv::Mat(10, 10, CV_8U, cv::Scalar(0));
  EXPECT_MPC_ERROR(MakeBackgroundPlate(samples), kMismatch, "model mask");
  samples = Walk();
  samples[2].picture = cv::Mat(10, 10, CV_8UC3, cv::Scalar::all(0));
  samples[2].model_mask = cv::Mat(10, 10, CV_8U, cv::Scalar(0));
  EXPECT_MPC_ERROR(MakeBackgroundPlate(samples), kMismatch, "different sizes");
  EXPECT_MPC_ERROR(MakeBackgroundPlate(Walk(), 1, {999, 9}), kMismatch, "no place");
}

// A figure in the colours of what is behind it, and no other picture to compare with.
struct Camouflage {
  TestSceneOptions options{.same_texture = true, .seed = 77};
  TestScene scene = MakeScene(options);
  FrameInput frame;

  Camouflage() {
    frame.picture = scene.picture;
    frame.model_mask = WrongModel(options, 0.025);
    frame.skeleton_mask = scene.skeleton;
  }
};

TEST(BackgroundPlate, ShowsAnActorOfTheBackgroundsColours) {
  Camouflage c;
  const double without = MaskIou(ExtractSilhouette(c.frame).mask, c.scene.truth);
  c.frame.background = MakeBackgroundPlate(Walk(c.options, 0.01));
  const Silhouette with = ExtractSilhouette(c.frame);
  EXPECT_EQ(with.state, SilhouetteState::kCut);
  EXPECT_LT(1 - MaskIou(with.mask, c.scene.truth), (1 - without) / 4);
  EXPECT_GT(with.confidence, 0.3);
}

TEST(BackgroundPlate, DoesNotTakeAShadowForTheActor) {
  const TestSceneOptions options;
  TestScene scene = MakeScene(options);
  // The lower half of the picture, which has legs in it, gets two thirds of the light.
  cv::Mat shaded = scene.picture(cv::Rect(0, 230, 240, 90));
  cv::Mat actor = shaded.clone();
  shaded *= 2.0 / 3;
  actor.copyTo(shaded, scene.truth(cv::Rect(0, 230, 240, 90)));
  FrameInput frame;
  frame.picture = scene.picture;
  frame.model_mask = WrongModel(options, 0.02);
  frame.skeleton_mask = scene.skeleton;
  frame.background = MakeBackgroundPlate(Walk());
  EXPECT_GT(MaskIou(ExtractSilhouette(frame).mask, scene.truth), 0.95);
}

TEST(BackgroundPlate, AnUnknownOneChangesNothing) {
  Camouflage c;
  const Silhouette without = ExtractSilhouette(c.frame);
  c.frame.background.picture = cv::Mat(c.scene.picture.size(), CV_8UC3, cv::Scalar(1, 2, 3));
  c.frame.background.spread =
      cv::Mat(c.scene.picture.size(), CV_8U, cv::Scalar(BackgroundPlate::kUnknown));
  EXPECT_EQ(cv::norm(ExtractSilhouette(c.frame).mask, without.mask, cv::NORM_INF), 0);
}

TEST(BackgroundPlate, ThePaperHasNone) {
  Camouflage c;
  const Silhouette without = ExtractSilhouette(c.frame, SegmentationOptions::Paper());
  c.frame.background = MakeBackgroundPlate(Walk(c.options));
  EXPECT_EQ(cv::norm(ExtractSilhouette(c.frame, SegmentationOptions::Paper()).mask, without.mask,
                     cv::NORM_INF),
            0);
}

TEST(BackgroundPlate, OfAnotherSizeIsRefused) {
  Camouflage c;
  c.frame.background.picture = cv::Mat(7, 5, CV_8UC3, cv::Scalar::all(0));
  c.frame.background.spread = cv::Mat(7, 5, CV_8U, cv::Scalar(0));
  EXPECT_MPC_ERROR(ExtractSilhouette(c.frame), kMismatch, "background plate is 5x7");
}

}  // namespace
}  // namespace mpc
