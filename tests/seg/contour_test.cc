#include "mpc/seg/contour.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "random_mask.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

// Inside-ness of pixels of a disc: 0 or 1 by their centres, or the covered area.
cv::Mat Disc(const cv::Size& size, const Eigen::Vector2d& centre, double radius,
             bool covered_area) {
  cv::Mat1f alpha(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const double excess = radius - std::hypot(x - centre.x(), y - centre.y());
      alpha(y, x) = covered_area ? static_cast<float>(std::clamp(excess + 0.5, 0.0, 1.0))
                                 : (excess >= 0 ? 1.F : 0.F);
    }
  }
  return alpha;
}

struct Errors {
  double mean = 0;
  double largest = 0;
  double least_cos = 1;
};

Errors CompareWithCircle(const Contour2d& contour, const Eigen::Vector2d& centre, double radius) {
  Errors errors;
  for (Eigen::Index i = 0; i < contour.points.cols(); ++i) {
    const Eigen::Vector2d out = contour.points.col(i) - centre;
    const double error = std::abs(out.norm() - radius);
    errors.mean += error / static_cast<double>(contour.points.cols());
    errors.largest = std::max(errors.largest, error);
    errors.least_cos = std::min(errors.least_cos, contour.normals.col(i).dot(out.normalized()));
  }
  return errors;
}

TEST(Contour, CircleToATenthOfAPixel) {
  for (const double radius : {12.3, 25.0, 60.7}) {
    const Eigen::Vector2d centre(80.4, 75.8);
    const cv::Mat mask = Disc({160, 150}, centre, radius, false) > 0.5;
    const Contour2d contour = ExtractContour(mask);
    ASSERT_GT(contour.points.cols(), static_cast<Eigen::Index>(6 * radius));
    const Errors errors = CompareWithCircle(contour, centre, radius);
    EXPECT_LT(errors.mean, 0.1) << radius;
    EXPECT_LT(errors.largest, 0.5) << radius;  // a row of pixels may hide that much of an arc
    EXPECT_GT(errors.least_cos, std::cos(0.18)) << radius;
    EXPECT_LT((contour.normals.colwise().norm().array() - 1).abs().maxCoeff(), 1e-6);
  }
}

TEST(Contour, SoftFieldPlacesThePoints) {
  const Eigen::Vector2d centre(50.3, 49.1);
  const cv::Mat alpha = Disc({100, 100}, centre, 30.4, true);
  cv::Mat bytes;
  alpha.convertTo(bytes, CV_8U, 255);
  for (const cv::Mat& soft : {alpha, bytes}) {
    const Errors errors = CompareWithCircle(ExtractContour(alpha > 0.5, soft), centre, 30.4);
    EXPECT_LT(errors.mean, 0.07);
    EXPECT_LT(errors.largest, 0.2);
  }
}

TEST(Contour, HolesPointInwards) {
  cv::Mat mask(60, 60, CV_8U, cv::Scalar(255));
  mask -= cv::Mat(Disc({60, 60}, {30, 30}, 12, false) > 0.5);
  const Contour2d contour = ExtractContour(mask);
  ASSERT_GT(contour.points.cols(), 50);
  for (Eigen::Index i = 0; i < contour.points.cols(); ++i) {
    const Eigen::Vector2d to_centre = Eigen::Vector2d(30, 30) - contour.points.col(i);
    EXPECT_GT(contour.normals.col(i).dot(to_centre.normalized()), 0.98);
  }
}

TEST(Contour, BorderOfThePictureIsNoOutline) {
  EXPECT_EQ(ExtractContour(cv::Mat(20, 30, CV_8U, cv::Scalar(255))).points.cols(), 0);
  cv::Mat half(40, 30, CV_8U, cv::Scalar(0));
  half.rowRange(15, 40).setTo(255);  // reaches left, right and lower border
  const Contour2d contour = ExtractContour(half);
  ASSERT_EQ(contour.points.cols(), 30);
  for (Eigen::Index i = 0; i < 30; ++i) {
    EXPECT_NEAR(contour.points(1, i), 14.5, 1e-4);
    EXPECT_NEAR(contour.normals(1, i), -1, 1e-4);
  }
}

TEST(Contour, ThinAndSmallPiecesStay) {
  cv::Mat mask(30, 30, CV_8U, cv::Scalar(0));
  mask.at<uint8_t>(10, 10) = 1;
  mask.row(20).setTo(1);
  const Contour2d contour = ExtractContour(mask);
  EXPECT_EQ(contour.points.cols(), 4 + 60);
  EXPECT_TRUE(contour.points.allFinite());
  for (Eigen::Index i = 0; i < contour.points.cols(); ++i) {
    EXPECT_NEAR(contour.normals.col(i).norm(), 1, 1e-6);
    const double y = contour.points(1, i);
    const Eigen::Vector2d from =
        y < 15 ? Eigen::Vector2d(10, 10) : Eigen::Vector2d(contour.points(0, i), 20);
    EXPECT_GT(contour.normals.col(i).dot(contour.points.col(i) - from), -1e-9);
    EXPECT_LT((contour.points.col(i) - from).norm(), 1.5);
  }
}

TEST(Contour, OnePointPerPairOfNeighbours) {
  cv::RNG rng(7);
  for (int trial = 0; trial < 500; ++trial) {
    const cv::Mat mask = testing::RandomMask(&rng);
    const cv::Mat inside = mask != 0;
    int num_pairs = 0;
    for (int y = 0; y < mask.rows; ++y) {
      for (int x = 0; x < mask.cols; ++x) {
        const uint8_t here = inside.at<uint8_t>(y, x);
        num_pairs += x + 1 < mask.cols && inside.at<uint8_t>(y, x + 1) != here;
        num_pairs += y + 1 < mask.rows && inside.at<uint8_t>(y + 1, x) != here;
      }
    }
    ASSERT_EQ(ExtractContour(mask).points.cols(), num_pairs) << mask;
  }
}

TEST(Contour, EmptyAndTinyMasks) {
  EXPECT_EQ(ExtractContour(cv::Mat::zeros(20, 20, CV_8U)).points.cols(), 0);
  EXPECT_EQ(ExtractContour(cv::Mat::ones(1, 1, CV_8U)).points.cols(), 0);
  cv::Mat pair = cv::Mat::zeros(1, 2, CV_8U);
  pair.at<uint8_t>(0, 1) = 1;
  EXPECT_EQ(ExtractContour(pair).points.cols(), 1);
}

TEST(Contour, RefusesOtherTypesAndSizes) {
  EXPECT_MPC_ERROR(ExtractContour(cv::Mat()), kInvalidArgument, "mask");
  EXPECT_MPC_ERROR(ExtractContour(cv::Mat::zeros(4, 4, CV_16U)), kInvalidArgument, "CV_16U");
  EXPECT_MPC_ERROR(ExtractContour(cv::Mat::zeros(4, 4, CV_8U), cv::Mat::zeros(4, 5, CV_8U)),
                   kMismatch, "5x4");
}

}  // namespace
}  // namespace mpc
