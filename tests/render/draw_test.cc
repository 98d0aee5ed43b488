#include "mpc/render/draw.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "support/expect_error.h"

namespace mpc {
namespace {

using enum JointId;

int Changed(const cv::Mat& image) { return cv::countNonZero(image.reshape(1)); }

class DrawTest : public ::testing::Test {
 protected:
  Camera camera_ = Camera::FromFov(320, 240, 1.0);
  cv::Mat image_ = cv::Mat::zeros(240, 320, CV_8UC3);
};

TEST_F(DrawTest, StickFigureShowsSidesInTheirColours) {
  const std::vector<JointId> joints = {kLeftHip, kLeftKnee, kRightHip, kRightKnee};
  Eigen::Matrix3Xd x(3, 4);
  x << 0.4, 0.4, -0.4, -0.4, -0.3, 0.3, -0.3, 0.3, 2, 2, 2, 2;
  DrawStickFigure(camera_, joints, x, &image_);
  Eigen::Vector2d left, right;
  ASSERT_TRUE(Project(camera_, {0.4, 0, 2}, &left));
  ASSERT_TRUE(Project(camera_, {-0.4, 0, 2}, &right));
  const auto at = [&](const Eigen::Vector2d& p) {
    return image_.at<cv::Vec3b>(static_cast<int>(std::lround(p.y())),
                                static_cast<int>(std::lround(p.x())));
  };
  EXPECT_GT(at(left)[0], at(left)[2]);
  EXPECT_GT(at(right)[2], at(right)[0]);
}

TEST_F(DrawTest, UndrawableJointsAreLeftOut) {
  const std::vector<JointId> joints = {kLeftHip, kLeftKnee, kLeftAnkle, kLeftToe};
  Eigen::Matrix3Xd x = Eigen::Matrix3Xd::Zero(3, 4);
  x.col(0) << 0, 0, -2;
  x.col(1) << std::numeric_limits<double>::quiet_NaN(), 0, 2;
  x.col(2) << 1e9, 0, 1;
  x.col(3) << 0, 0, 1e-300;
  DrawStickFigure(camera_, joints, x, &image_);
  EXPECT_EQ(Changed(image_), 0);
}

TEST_F(DrawTest, DetectionsGrowWithConfidenceAndVanishWithoutIt) {
  const std::vector<JointId> joints = {kNeck};
  Detections2d::Frame frame{Eigen::Vector2d(100, 100), Eigen::VectorXd::Zero(1)};
  DrawDetections(joints, frame, &image_);
  EXPECT_EQ(Changed(image_), 0);
  frame.confidence[0] = 0.1;
  DrawDetections(joints, frame, &image_);
  const int faint = Changed(image_);
  EXPECT_GT(faint, 0);
  image_.setTo(0);
  frame.confidence[0] = 1;
  DrawDetections(joints, frame, &image_);
  EXPECT_GT(Changed(image_), faint);
  image_.setTo(0);
  frame.pixels(0, 0) = 1e300;
  DrawDetections(joints, frame, &image_);
  EXPECT_EQ(Changed(image_), 0);
}

TEST_F(DrawTest, MeshOverlayLetsTheFrameShine) {
  Eigen::Matrix3Xf positions(3, 3);
  positions << -1, 1, 0, -1, -1, 1, 2, 2, 2;
  Triangles triangles(3, 1);
  triangles << 0, 1, 2;
  image_.setTo(cv::Scalar(0, 0, 200));
  cv::Mat dark = cv::Mat::zeros(240, 320, CV_8UC3);
  DrawMeshOverlay(camera_, positions, triangles, &image_);
  DrawMeshOverlay(camera_, positions, triangles, &dark);
  EXPECT_GT(dark.at<cv::Vec3b>(115, 160)[0], 50);
  EXPECT_GT(image_.at<cv::Vec3b>(115, 160)[2], dark.at<cv::Vec3b>(115, 160)[2] + 50);
}

TEST_F(DrawTest, WrongSizesAreRefused) {
  const std::vector<JointId> joints = {kNeck, kHeadTop};
  EXPECT_MPC_ERROR(DrawStickFigure(camera_, joints, Eigen::Matrix3Xd::Zero(3, 3), &image_),
                   kMismatch, "3 positions for 2 joints");
  const Detections2d::Frame frame{Eigen::Matrix2Xd::Zero(2, 2), Eigen::VectorXd::Zero(1)};
  EXPECT_MPC_ERROR(DrawDetections(joints, frame, &image_), kMismatch, "1 positions");
}

}  // namespace
}  // namespace mpc
