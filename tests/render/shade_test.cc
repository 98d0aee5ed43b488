#include "mpc/render/shade.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "render/meshes.h"
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
  appearance_.textures = {cv::Mat(64, 64, CV_8UC3, cv::Scalar(255, 0, 0))};
  appearance_.textures[0].colRange(32, 64) = cv::Scalar(0, 0, 255);
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

// The share of the picture that a ball of 0.8 m at a place covers, 0 to 1.
double BallShare(int width, int height, const Eigen::Vector3d& centre) {
  const Camera camera = Camera::FromFov(width, height, 1);
  const TriangleMesh ball = testing::Ball(centre, 0.8);
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(7, 7, 7));
  MeshAppearance appearance;
  appearance.ambient = 0.5;
  ShadeMesh(camera, ball.positions, ball.triangles, appearance, 1, &image);
  cv::Mat drawn;
  cv::extractChannel(image != cv::Scalar(7, 7, 7), drawn, 0);
  return static_cast<double>(cv::countNonZero(drawn)) / static_cast<double>(drawn.total());
}

TEST_F(ShadeTest, PicturesOfAllSizesShowTheSame) {
  const double hd = BallShare(1920, 1080, {0.2, 0, 3});
  EXPECT_GT(hd, 0.2);
  EXPECT_NEAR(BallShare(3840, 2160, {0.2, 0, 3}), hd, 0.001);
  EXPECT_NEAR(BallShare(64, 36, {0.2, 0, 3}), hd, 0.02);
}

TEST_F(ShadeTest, PartlyAndWhollyOutsideThePicture) {
  const double whole = BallShare(160, 120, {0, 0, 4});
  const double half = BallShare(160, 120, {4 * std::tan(0.5), 0, 4});
  EXPECT_NEAR(half, 0.5 * whole, 0.1 * whole);
  EXPECT_EQ(BallShare(160, 120, {9, 0, 4}), 0);
  EXPECT_EQ(BallShare(160, 120, {0, 0, -4}), 0);
  EXPECT_EQ(BallShare(160, 120, {0, 0, 0.1}), 1) << "the camera is inside";
}

TEST_F(ShadeTest, EmptyMeshLeavesThePictureAlone) {
  const cv::Mat before = image_.clone();
  ShadeMesh(camera_, Eigen::Matrix3Xf(3, 0), Triangles(3, 0), appearance_, 1, &image_);
  EXPECT_EQ(cv::norm(before, image_, cv::NORM_INF), 0);
}

TEST_F(ShadeTest, ColoursSurviveClippingAtTheNearPlane) {
  // A floor from behind the camera to far ahead, coloured by distance: red grows with z.
  positions_ << -3, 3, 3, -3, 1, 1, 1, 1, -10, -10, 10, 10;
  appearance_.vertex_bgr.resize(3, 4);
  appearance_.vertex_bgr << 0, 0, 0, 0, 0, 0, 0, 0, -200, -200, 200, 200;
  ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_);
  for (const int y : {40, 45, 50, 59}) {
    const double z = camera_.fy / (y - camera_.cy);  // the floor is 1 m below
    EXPECT_NEAR(image_.at<cv::Vec3b>(y, 40)[2], 20 * z, 2) << y;
    EXPECT_NEAR(image_.at<cv::Vec3b>(y, 38)[2], 20 * z, 2) << y;
  }
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
  appearance_.textures = {cv::Mat(4, 4, CV_8UC3)};
  EXPECT_MPC_ERROR(ShadeMesh(camera_, positions_, triangles_, appearance_, 1, &image_),
                   kInvalidArgument, "texture");
}

}  // namespace
}  // namespace mpc
