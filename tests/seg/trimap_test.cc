#include "mpc/seg/trimap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <random>

#include "support/expect_error.h"

namespace mpc {
namespace {

// Some overlapping discs and a bar, in parts outside the picture.
cv::Mat RandomBody(const cv::Size& size, uint32_t seed) {
  std::mt19937 rng(seed);
  cv::Mat mask(size, CV_8U, cv::Scalar(0));
  for (int i = 0; i < 4; ++i) {
    cv::circle(mask,
               {static_cast<int>(rng() % static_cast<unsigned>(size.width)),
                static_cast<int>(rng() % static_cast<unsigned>(size.height))},
               static_cast<int>(4 + rng() % 12), 255, cv::FILLED);
  }
  cv::line(mask, {size.width / 4, size.height / 2}, {size.width, size.height / 2}, 255, 5);
  return mask;
}

// Eq. 9 word for word: for every pixel, look at all others.
cv::Mat TrimapTwin(const cv::Mat& r, const cv::Mat& m, const TrimapRadii& radii) {
  cv::Mat trimap(m.size(), CV_8U);
  for (int y = 0; y < m.rows; ++y) {
    for (int x = 0; x < m.cols; ++x) {
      bool eroded = m.at<uint8_t>(y, x) != 0, dilated = false;
      for (int v = 0; v < m.rows; ++v) {
        for (int u = 0; u < m.cols; ++u) {
          const double distance = std::hypot(u - x, v - y);
          if (m.at<uint8_t>(v, u) == 0 && distance <= radii.erode_px) eroded = false;
          if (m.at<uint8_t>(v, u) != 0 && distance <= radii.dilate_px) dilated = true;
        }
      }
      const bool in_model = m.at<uint8_t>(y, x) != 0;
      uint8_t& t = trimap.at<uint8_t>(y, x);
      if (r.at<uint8_t>(y, x) != 0 || eroded) {
        t = kTrimapForeground;
      } else if (in_model) {
        t = kTrimapUnknownForeground;
      } else {
        t = dilated ? kTrimapUnknownBackground : kTrimapBackground;
      }
    }
  }
  return trimap;
}

TEST(Trimap, EqualsTheEquationWordForWord) {
  for (uint32_t seed = 0; seed < 5; ++seed) {
    const cv::Mat m = RandomBody({56, 48}, seed);
    const cv::Mat r = RandomBody({56, 48}, seed + 100);
    const TrimapRadii radii = {1.0 + 0.7 * seed, 7.0 - 0.6 * seed};
    EXPECT_EQ(cv::countNonZero(MakeTrimap(r, m, radii) != TrimapTwin(r, m, radii)), 0) << seed;
  }
}

TEST(Trimap, PartsArePartitionAndUnknownPartsAreSplitByTheModel) {
  const cv::Mat m = RandomBody({90, 70}, 3);
  const cv::Mat t = MakeTrimap({}, m, {4, 6});
  EXPECT_EQ(cv::countNonZero(t > kTrimapUnknownForeground), 0);
  const cv::Mat in_model = (t == kTrimapForeground) | (t == kTrimapUnknownForeground);
  EXPECT_EQ(cv::countNonZero(in_model != (m != 0)), 0);
}

TEST(Trimap, RadiusZeroLeavesNothingUnknown) {
  const cv::Mat m = RandomBody({90, 70}, 4);
  EXPECT_EQ(cv::countNonZero(MakeTrimap({}, m, {0, 0}) != (m / 255)), 0);
}

TEST(Trimap, BorderOfThePictureErodesNothing) {
  const cv::Mat all(40, 60, CV_8U, cv::Scalar(1));
  EXPECT_EQ(cv::countNonZero(MakeTrimap({}, all, {10, 10}) != kTrimapForeground), 0);
  cv::Mat right(40, 60, CV_8U, cv::Scalar(0));
  right.colRange(20, 60).setTo(255);
  const cv::Mat t = MakeTrimap({}, right, {5, 5});
  EXPECT_EQ(t.at<uint8_t>(0, 59), kTrimapForeground);
  EXPECT_EQ(t.at<uint8_t>(39, 25), kTrimapForeground);
  EXPECT_EQ(t.at<uint8_t>(20, 24), kTrimapUnknownForeground);
}

TEST(Trimap, EmptyModelIsBackgroundButForTheSkeleton) {
  const cv::Mat none(40, 60, CV_8U, cv::Scalar(0));
  EXPECT_EQ(cv::countNonZero(MakeTrimap({}, none, {5, 5})), 0);
  cv::Mat r = none.clone();
  r.at<uint8_t>(7, 9) = 1;
  EXPECT_EQ(MakeTrimap(r, none, {5, 5}).at<uint8_t>(7, 9), kTrimapForeground);
}

TEST(Trimap, ActorSizeScalesWithThePicture) {
  const cv::Mat m = RandomBody({90, 70}, 5);
  cv::Mat twice;
  cv::resize(m, twice, {}, 2, 2, cv::INTER_NEAREST);
  EXPECT_DOUBLE_EQ(ActorSizePx(twice), 2 * ActorSizePx(m));
  EXPECT_EQ(ActorSizePx(cv::Mat::zeros(5, 5, CV_8U)), 0);
}

TEST(Trimap, RefusesWhatIsNoMask) {
  const cv::Mat m(40, 60, CV_8U, cv::Scalar(1));
  EXPECT_MPC_ERROR(MakeTrimap({}, {}, {1, 1}), kInvalidArgument, "model mask");
  EXPECT_MPC_ERROR(MakeTrimap({}, cv::Mat(4, 4, CV_32F), {1, 1}), kInvalidArgument, "CV_32F");
  EXPECT_MPC_ERROR(MakeTrimap(cv::Mat::zeros(40, 61, CV_8U), m, {1, 1}), kMismatch, "61x40");
  EXPECT_MPC_ERROR(MakeTrimap({}, m, {-1, 1}), kInvalidArgument, "radii");
  EXPECT_MPC_ERROR(MakeTrimap({}, m, {1, std::numeric_limits<double>::quiet_NaN()}),
                   kInvalidArgument, "radii");
}

}  // namespace
}  // namespace mpc
