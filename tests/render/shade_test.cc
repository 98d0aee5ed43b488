#include "mpc/render/shade.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/expect_error.h"

namespace mpc {
namespace {

// A square facing the camera that fills the picture's middle, at 2 m.
class ShadeTest : public ::testing::Test {
 protected:
  ShadeTest() {
    camera_.width = 80;
    camera_.height = 60;
    camera_.fx = camera_.fy = 80;
    camera_.cx = 39.5;
    camera_.cy = 29.5;
    positions_.resize(3, 4);
    positions_ << -0.5f, 0.5f, 0.5f, -0.5f, -0.5f, -0.5f, 0.5f, 0.5f, 2, 2, 2, 2;
    triangles_.resize(3, 2);
    triangles_ << 0, 0, 2, 3, 1, 2;
    appearance_.ambient = 1;
  }
  cv::Vec3b Middle() const { return image_.at<cv::Vec3b>(29, 40); }
  Camera camera_;
  Eigen::Matrix3Xf positions_;
  Triangles triangles_;
  MeshAppearance appearance_;
  cv::Mat image_ = cv::Mat(60, 80, CV_8UC3, cv::Scalar(10, 20, 30));
};

TEST_F(ShadeTest, BlendsOverTheBackground) {
  appearance_.bgr = {110, 120, 130};
  ShadeMesh(camera_, positions_, triangles_, appearance_, 0.5, &image_);
  EXPECT_EQ(Middle(), cv::Vec3b(60, 70, 80));
  EXPECT_EQ(image_.at<cv::Vec3b>(2, 2), cv::Vec3b(10, 20, 30));
}

TEST_F(ShadeTest, LightFallsWithTheAngle) {
  appearance_.bgr = {200, 200, 200};
  appearance_.ambient = 0;
  ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_);
  EXPECT_GT(Middle()[0], 185);  // its vertices are seen a little aslant
  for (int i = 0; i < 4; ++i) positions_(2, i) += 1.0f * positions_(0, i);  // turned by 45 degrees
  ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_);
  EXPECT_NEAR(Middle()[0], 200 * std::sqrt(0.5), 8);
}

TEST_F(ShadeTest, VertexAndTriangleColours) {
  appearance_.triangle_bgr.resize(3, 2);
  appearance_.triangle_bgr << 255, 0, 0, 255, 0, 0;
  ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_);
  EXPECT_EQ(image_.at<cv::Vec3b>(20, 45), cv::Vec3b(255, 0, 0));  // triangle 0: upper right
  EXPECT_EQ(image_.at<cv::Vec3b>(40, 35), cv::Vec3b(0, 255, 0));
  appearance_.vertex_bgr.resize(3, 4);
  appearance_.vertex_bgr << 0, 200, 200, 0, 0, 0, 0, 0, 0, 0, 0, 0;
  ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_);
  EXPECT_NEAR(Middle()[0], 100, 4);
  EXPECT_GT(image_.at<cv::Vec3b>(29, 55)[0], image_.at<cv::Vec3b>(29, 25)[0] + 100);
}

TEST_F(ShadeTest, TextureIsPerspectiveCorrect) {
  // Left half of the texture blue, right half red; the square leans away to the right, so the seam
  // appears where the 3D middle projects, not in the middle of the picture of the square.
  appearance_.texture = cv::Mat(64, 64, CV_8UC3, cv::Scalar(255, 0, 0));
  appearance_.texture.colRange(32, 64) = cv::Scalar(0, 0, 255);
  appearance_.uv.resize(2, 4);
  appearance_.uv << 0, 1, 1, 0, 0, 0, 1, 1;
  for (int i = 0; i < 4; ++i) positions_(2, i) = positions_(0, i) > 0 ? 4.0f : 1.5f;
  ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_);
  // The 3D middle is at x = 0: column 39.5.
  EXPECT_EQ(image_.at<cv::Vec3b>(29, 36), cv::Vec3b(255, 0, 0));
  EXPECT_EQ(image_.at<cv::Vec3b>(29, 43), cv::Vec3b(0, 0, 255));
}

TEST_F(ShadeTest, ANonFiniteVertexHurtsOnlyItsTriangles) {
  appearance_.ambient = 0.5;
  appearance_.bgr = {200, 200, 200};
  positions_(0, 3) = std::numeric_limits<float>::quiet_NaN();
  ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_);
  EXPECT_GT(image_.at<cv::Vec3b>(20, 45)[0], 90);                  // triangle 0 has no such vertex
  EXPECT_EQ(image_.at<cv::Vec3b>(40, 35), cv::Vec3b(10, 20, 30));  // triangle 1 has
}

TEST_F(ShadeTest, MisuseIsRefused) {
  EXPECT_MPC_ERROR(ShadeMesh(camera_, positions_, triangles_, appearance_, 1.5, &image_),
                   kInvalidArgument, "1.5");
  cv::Mat small(10, 10, CV_8UC3);
  EXPECT_MPC_ERROR(ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &small),
                   kInvalidArgument, "10 x 10");
  appearance_.vertex_bgr.resize(3, 3);
  EXPECT_MPC_ERROR(ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_),
                   kInvalidArgument, "vertex colours");
  appearance_.vertex_bgr.resize(3, 0);
  appearance_.texture = cv::Mat(4, 4, CV_8UC3);
  EXPECT_MPC_ERROR(ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_),
                   kInvalidArgument, "texture");
}

}  // namespace
}  // namespace mpc
