// Where people are, and how often to look.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "mpc/detect/clip_detector.h"
#include "mpc/detect/person_region.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::Vector2d;

TEST(PersonRegion, IsUprightAroundAPersonWhoStands) {
  const PersonRegion region = PersonRegion::Around({100, 200}, {100, 120});
  EXPECT_NEAR(region.rotation_rad, 0, 1e-12);
  EXPECT_NEAR(region.size_px, 200, 1e-9);
  EXPECT_TRUE(region.PixelAt({0.5, 0.5}).isApprox(Vector2d(100, 200)));
  EXPECT_TRUE(region.PixelAt({0, 0}).isApprox(Vector2d(0, 100)));
}

TEST(PersonRegion, TurnsWithThePerson) {
  const PersonRegion region = PersonRegion::Around({0, 0}, {80, 0});  // lies, head to the right
  EXPECT_NEAR(region.rotation_rad, std::numbers::pi / 2, 1e-12);
  EXPECT_TRUE(region.PixelAt({0.5, 0}).isApprox(Vector2d(100, 0)));  // the head's end is its top
}

// A picture whose colours tell the place, so that a crop shows where it was taken.
TEST(PersonRegion, CropShowsWhatLiesInTheSquare) {
  cv::Mat picture(240, 320, CV_32FC3);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      picture.at<cv::Vec3f>(y, x) = {static_cast<float>(x), static_cast<float>(y), 1};
    }
  }
  for (const double size : {24.0, 64.0, 150.0}) {  // enlarged, as it is, shrunk
    const PersonRegion region = {.center = {160, 120}, .size_px = size, .rotation_rad = 0.4};
    constexpr int kSide = 64;
    const cv::Mat square = CropRegion(picture, region, kSide);
    for (const cv::Point& p : {cv::Point(0, 0), {63, 0}, {10, 50}, {31, 32}}) {
      const Vector2d expected = region.PixelAt(Vector2d(p.x + 0.5, p.y + 0.5) / kSide);
      const cv::Vec3f seen = square.at<cv::Vec3f>(p);
      EXPECT_NEAR(seen[0], expected.x(), 0.05) << size;
      EXPECT_NEAR(seen[1], expected.y(), 0.05) << size;
    }
  }
}

TEST(PersonRegion, ShrinkingAveragesFineStripes) {
  cv::Mat stripes(256, 256, CV_8UC3, cv::Scalar::all(0));
  for (int x = 0; x < 256; x += 2) stripes.col(x).setTo(cv::Scalar::all(200));
  const cv::Mat square = CropRegion(stripes, {.center = {127.5, 127.5}, .size_px = 256}, 64);
  double low = 0, high = 0;
  cv::minMaxLoc(square.reshape(1), &low, &high);
  EXPECT_NEAR(low, 100, 2);
  EXPECT_NEAR(high, 100, 2);
}

TEST(PersonRegion, MovesEvenlyAndTurnsTheShortWay) {
  constexpr double kPi = std::numbers::pi;
  const PersonRegion a = {.center = {10, 20}, .size_px = 100, .rotation_rad = kPi - 0.1};
  const PersonRegion b = {.center = {30, 0}, .size_px = 400, .rotation_rad = 0.3 - kPi};
  EXPECT_LT(RegionDistance(RegionBetween(a, b, 0), a), 1e-12);
  EXPECT_LT(RegionDistance(RegionBetween(a, b, 1), b), 1e-12);
  const PersonRegion middle = RegionBetween(a, b, 0.5);
  EXPECT_TRUE(middle.center.isApprox(Vector2d(20, 10)));
  EXPECT_NEAR(middle.size_px, 200, 1e-9);
  EXPECT_NEAR(std::remainder(middle.rotation_rad - (kPi + 0.1), 2 * kPi), 0, 1e-12);
}

TEST(PersonRegion, PasteUndoesCrop) {
  cv::Mat mask(200, 200, CV_32F, cv::Scalar(0));
  cv::circle(mask, {110, 90}, 25, 1, cv::FILLED);
  const PersonRegion region = {.center = {105, 95}, .size_px = 90, .rotation_rad = -0.7};
  const cv::Mat back = PasteRegion(CropRegion(mask, region, 128), region, mask.size());
  EXPECT_LT(cv::countNonZero((back > 0.5) != (mask > 0.5)), 30);
  EXPECT_EQ(back.at<float>(5, 5), 0);
}

TEST(DetectionStride, FollowsTheBandLimit) {
  EXPECT_EQ(DetectionStride(30, 6), 2);
  EXPECT_EQ(DetectionStride(30, 4), 3);
  EXPECT_EQ(DetectionStride(60, 4), 5);
  EXPECT_EQ(DetectionStride(5, 4), 1);
  EXPECT_EQ(DetectionStride(240, 4), 20);
  EXPECT_EQ(DetectionStride(30, 1000), 1);
}

TEST(DetectionStride, IsTwiceAsLongWhereThatStillLooksOncePerPeriod) {
  EXPECT_EQ(EvenDetectionStride(60, 6), 6);
  EXPECT_EQ(EvenDetectionStride(30, 6), 4);
  EXPECT_EQ(EvenDetectionStride(29.97, 6), 4);
  EXPECT_EQ(EvenDetectionStride(24, 6), 2);
  EXPECT_EQ(EvenDetectionStride(12, 6), 2);
  EXPECT_EQ(EvenDetectionStride(11, 6), 1);
  EXPECT_EQ(EvenDetectionStride(5, 6), 1);
  EXPECT_EQ(EvenDetectionStride(240, 4), 40);
}

TEST(ClipDetectorOptions, NameEveryFault) {
  ClipDetectorOptions options;
  options.person = 0;
  options.every = -1;
  EXPECT_MPC_ERROR(options.Validate(), kInvalidArgument, "person is 0");
  EXPECT_MPC_ERROR(options.Validate(), kInvalidArgument, "every is -1");
}

}  // namespace
}  // namespace mpc
