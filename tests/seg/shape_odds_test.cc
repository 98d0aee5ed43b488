#include "shape_odds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mpc {
namespace {

// A disc of radius 40 in the middle of 200 x 200 pixels, grown by `grow`.
cv::Mat Disc(int grow) {
  cv::Mat mask(200, 200, CV_8U, cv::Scalar(0));
  cv::circle(mask, {100, 100}, 40 + grow, 255, cv::FILLED);
  return mask;
}

const cv::Mat kAllSure(200, 200, CV_8U, cv::Scalar(255));

cv::Mat1f MeasuredOdds(const cv::Mat1f& distance, const cv::Mat& labels, const cv::Mat& is_sure,
                       double reach_px) {
  return OutlineOdds(distance, MeasurePrecision(distance, labels, is_sure, reach_px));
}

// Odds on the line from the middle to the right, `d` px outside of the model's outline.
float Outside(const cv::Mat1f& odds, int d) { return odds(100, 140 + d); }

TEST(SignedDistance, IsPositiveInside) {
  const cv::Mat1f distance = SignedDistance(Disc(0));
  EXPECT_NEAR(distance(100, 100), 40, 1);
  EXPECT_NEAR(distance(100, 150), -9.5, 1);
  EXPECT_NEAR(distance(100, 130), 10.5, 1);
}

TEST(MeasuredPrecision, ARightModelIsTrustedAWrongOneIsNot) {
  const cv::Mat1f distance = SignedDistance(Disc(0));
  const cv::Mat1f right = MeasuredOdds(distance, Disc(0), kAllSure, 15);
  const cv::Mat1f wrong = MeasuredOdds(distance, Disc(8), kAllSure, 15);
  // A Gaussian's two standard deviations (its mean absolute value is 8 px), and one in twenty.
  EXPECT_LT(Outside(right, 4), -2.5);
  EXPECT_GT(Outside(wrong, 4), -1);
  EXPECT_LT(Outside(wrong, 4), 0);
  for (const cv::Mat1f& odds : {right, wrong}) {
    EXPECT_NEAR(Outside(odds, 6), -Outside(odds, -5), 0.3);       // as sure on both sides
    EXPECT_GE(Outside(odds, 50), -std::log(1.05 / 0.05) - 1e-4);  // never surer than that
  }
}

TEST(MeasuredPrecision, IsMeasuredAroundEachPlace) {
  // The upper half is off by 8 px, the lower half is right.
  cv::Mat labels = Disc(8);
  Disc(0).rowRange(100, 200).copyTo(labels.rowRange(100, 200));
  const cv::Mat1f odds = MeasuredOdds(SignedDistance(Disc(0)), labels, kAllSure, 8);
  EXPECT_GT(odds(100 - 44, 100), odds(100 + 44, 100) + 1);
}

TEST(MeasuredPrecision, CountsOnlyWhatThePictureIsSureOf) {
  const cv::Mat1f distance = SignedDistance(Disc(0));
  const cv::Mat nothing(200, 200, CV_8U, cv::Scalar(0));
  EXPECT_EQ(cv::countNonZero(MeasuredOdds(distance, Disc(8), nothing, 15)), 0);
  // Of the cut only the right half is sure, and there the model is right.
  cv::Mat labels = Disc(8), sure = nothing.clone();
  Disc(0).colRange(100, 200).copyTo(labels.colRange(100, 200));
  sure.colRange(110, 200).setTo(255);
  EXPECT_LT(Outside(MeasuredOdds(distance, labels, sure, 15), 4), -2.5);
}

TEST(OutlineStrength, IsLessOnlyWhereAGoodModelEnds) {
  const cv::Mat1f distance = SignedDistance(Disc(0));
  const auto strength = [&](int grow) {
    return OutlineStrength(distance, MeasurePrecision(distance, Disc(grow), kAllSure, 15), 0.9, 1);
  };
  EXPECT_LT(Outside(strength(0), 0), 0.5);
  EXPECT_GT(Outside(strength(0), 8), 0.99);
  EXPECT_GT(Outside(strength(8), 0), 0.95);
  const cv::Mat1f nothing_measured(distance.size(), 0.F);
  EXPECT_EQ(cv::countNonZero(OutlineStrength(distance, nothing_measured, 0.9, 1) != 1), 0);
}

}  // namespace
}  // namespace mpc
