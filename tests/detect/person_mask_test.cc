// The networks' masks in the picture, at frames that were looked at and in between.
#include "mpc/detect/person_mask.h"

#include <gtest/gtest.h>

#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace mpc {
namespace {

constexpr int kSide = 64;
const cv::Size kPicture(200, 160);

PersonMask Disc(int frame, const Eigen::Vector2d& center, double size_px, double rotation_rad = 0) {
  PersonMask mask = {.frame = frame,
                     .region = {.center = center, .size_px = size_px, .rotation_rad = rotation_rad},
                     .probability = cv::Mat(kSide, kSide, CV_8U, cv::Scalar(0))};
  cv::circle(mask.probability, {kSide / 2, kSide / 4}, kSide / 8, 255, cv::FILLED);  // the "head"
  return mask;
}

cv::Point2d Center(const cv::Mat& picture) {
  const cv::Moments moments = cv::moments(picture);
  return {moments.m10 / moments.m00, moments.m01 / moments.m00};
}

TEST(PictureMask, LiesWhereTheRegionIs) {
  const cv::Mat picture = PictureMask(Disc(0, {100, 80}, 80), kPicture);
  ASSERT_EQ(picture.type(), CV_8U);
  ASSERT_EQ(picture.size(), kPicture);
  EXPECT_NEAR(Center(picture).x, 100, 1);
  EXPECT_NEAR(Center(picture).y, 60, 1);  // a quarter of the side above the middle
  EXPECT_EQ(picture.at<uchar>(5, 5), 0);
  EXPECT_EQ(picture.at<uchar>(60, 100), 255);
}

TEST(PictureMask, MovesAndTurnsEvenlyBetweenTwoLooks) {
  const std::vector<PersonMask> masks = {Disc(4, {60, 80}, 60), Disc(8, {120, 80}, 60)};
  for (const auto& [frame, x] : {std::pair(4, 60), {5, 75}, {6, 90}, {8, 120}}) {
    const cv::Mat picture = PictureMask(masks, frame, 4, kPicture);
    ASSERT_FALSE(picture.empty()) << frame;
    EXPECT_NEAR(Center(picture).x, x, 1) << frame;
  }
  // From a bit left to a bit right of upside down: the short way.
  constexpr double kPi = std::numbers::pi;
  const std::vector<PersonMask> turned = {Disc(0, {100, 80}, 80, kPi - 0.2),
                                          Disc(2, {100, 80}, 80, 0.2 - kPi)};
  const cv::Mat picture = PictureMask(turned, 1, 2, kPicture);
  EXPECT_NEAR(Center(picture).y, 100, 1);
}

TEST(PictureMask, IsEmptyWhereNobodyLooked) {
  const std::vector<PersonMask> masks = {Disc(4, {60, 80}, 60), Disc(12, {120, 80}, 60)};
  for (const int frame : {0, 3, 6, 13}) {
    EXPECT_TRUE(PictureMask(masks, frame, 4, kPicture).empty()) << frame;
  }
  EXPECT_TRUE(PictureMask({}, 0, 4, kPicture).empty());
}

}  // namespace
}  // namespace mpc
