#include "mpc/core/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <random>

#include "mpc/core/error.h"
#include "support/check_jacobian.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Camera PlainCamera() {
  Camera camera;
  camera.name = "test";
  camera.width = 1920;
  camera.height = 1080;
  camera.fx = 1400;
  camera.fy = 1420;
  camera.cx = 950.5;
  camera.cy = 533.25;
  return camera;
}

Camera DistortedCamera() {
  Camera camera = PlainCamera();
  camera.distortion = {-0.28, 0.09, 0.0011, -0.0007, -0.012};
  return camera;
}

// A point that projects near or inside the picture, 1 to 8 m away.
Eigen::Vector3d RandomPoint(std::mt19937* rng) {
  std::uniform_real_distribution<double> side(-0.65, 0.65), depth(1, 8);
  const double z = depth(*rng);
  return {side(*rng) * z, 0.6 * side(*rng) * z, z};
}

TEST(CameraTest, ProjectsAPointByHand) {
  Camera camera = PlainCamera();
  Eigen::Vector2d pixel;
  ASSERT_TRUE(Project(camera, {0.5, -0.25, 2}, &pixel));
  EXPECT_NEAR(pixel.x(), 1400 * 0.25 + 950.5, 1e-12);
  EXPECT_NEAR(pixel.y(), 1420 * -0.125 + 533.25, 1e-12);
}

TEST(CameraTest, ProjectionAgreesWithOpenCv) {
  std::mt19937 rng(1);
  for (const Camera& camera : {PlainCamera(), DistortedCamera()}) {
    const cv::Matx33d intrinsics(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3d x = RandomPoint(&rng);
      const std::vector<cv::Point3d> points = {{x.x(), x.y(), x.z()}};
      std::vector<cv::Point2d> expected;
      cv::projectPoints(points, cv::Vec3d::zeros(), cv::Vec3d::zeros(), intrinsics,
                        camera.distortion, expected);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(camera, x, &pixel));
      EXPECT_NEAR(pixel.x(), expected[0].x, 1e-9);
      EXPECT_NEAR(pixel.y(), expected[0].y, 1e-9);
    }
  }
}

TEST(CameraTest, JacobianMatchesDifferences) {
  std::mt19937 rng(2);
  for (const Camera& camera : {PlainCamera(), DistortedCamera()}) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d x = RandomPoint(&rng);
      Eigen::Vector2d pixel, pixel_alone;
      Eigen::Matrix<double, 2, 3> jacobian;
      ASSERT_TRUE(Project(camera, x, &pixel, &jacobian));
      ASSERT_TRUE(Project(camera, x, &pixel_alone));
      EXPECT_EQ(pixel, pixel_alone);
      const auto f = [&](const Eigen::VectorXd& p) -> Eigen::VectorXd {
        Eigen::Vector2d value;
        EXPECT_TRUE(Project(camera, p, &value));
        return value;
      };
      const auto plus = [](const Eigen::VectorXd& p, const Eigen::VectorXd& d) -> Eigen::VectorXd {
        return p + d;
      };
      testing::CheckJacobian(f, plus, x, jacobian, 1e-6);
    }
  }
}

TEST(CameraTest, RefusesPointsItCannotSee) {
  const double inf = std::numeric_limits<double>::infinity();
  for (const Camera& camera : {PlainCamera(), DistortedCamera()}) {
    Eigen::Vector2d pixel(7, 8);
    for (const Eigen::Vector3d& x :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0, 0, 1e-7),
          Eigen::Vector3d(kNan, 0, 1), Eigen::Vector3d(0, 0, kNan), Eigen::Vector3d(inf, 0, 1)}) {
      EXPECT_FALSE(Project(camera, x, &pixel));
    }
    EXPECT_EQ(pixel, Eigen::Vector2d(7, 8));
  }
}

TEST(CameraTest, RefusesPointsBeyondTheTurningPointOfTheDistortion) {
  Camera camera = PlainCamera();
  camera.distortion[0] = -0.3;  // r (1 - 0.3 r^2) turns back at r = 1 / sqrt(0.9)
  const double turn = 1 / std::sqrt(0.9);
  Eigen::Vector2d pixel;
  EXPECT_TRUE(Project(camera, {turn - 1e-6, 0, 1}, &pixel));
  EXPECT_FALSE(Project(camera, {turn + 1e-6, 0, 1}, &pixel));

  // With k2 the slope 1 - 0.9 s + 0.15 s^2 is positive again far outside: still refused there.
  camera.distortion[1] = 0.03;
  EXPECT_TRUE(Project(camera, {1.2, 0, 1}, &pixel));
  EXPECT_FALSE(Project(camera, {1.5, 0, 1}, &pixel));
  EXPECT_FALSE(Project(camera, {5, 0, 1}, &pixel));

  camera.distortion = {0, 0, 0, 0, -1.0 / 7};  // r (1 - r^6 / 7) turns back at r = 1
  EXPECT_TRUE(Project(camera, {1 - 1e-6, 0, 1}, &pixel));
  EXPECT_FALSE(Project(camera, {1 + 1e-6, 0, 1}, &pixel));

  camera.distortion = {0, 0, 0, -0.5, 0};  // x - 1.5 x^2 on the x axis turns back at x = 1/3
  EXPECT_TRUE(Project(camera, {1.0 / 3 - 1e-6, 0, 1}, &pixel));
  EXPECT_FALSE(Project(camera, {1.0 / 3 + 1e-6, 0, 1}, &pixel));
}

TEST(CameraTest, UndistortInvertsProject) {
  std::mt19937 rng(3);
  for (const Camera& camera : {PlainCamera(), DistortedCamera()}) {
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d x = RandomPoint(&rng);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(camera, x, &pixel));
      EXPECT_LT((Undistort(camera, pixel) - x.head<2>() / x.z()).norm(), 1e-10);
      EXPECT_LT(PixelRay(camera, pixel).cross(x.normalized()).norm(), 1e-10);
      EXPECT_GT(PixelRay(camera, pixel).z(), 0);
    }
  }
}

TEST(CameraTest, UndistortNearTheTurningPointAndBeyond) {
  Camera camera = PlainCamera();
  camera.distortion[0] = -0.3;
  Eigen::Vector2d pixel;
  ASSERT_TRUE(Project(camera, {1.0, 0.2, 1}, &pixel));
  EXPECT_LT((Undistort(camera, pixel) - Eigen::Vector2d(1.0, 0.2)).norm(), 1e-9);
  // Pixels no ray reaches give a finite ray near the turning circle.
  const double turn = 1 / std::sqrt(0.9);
  EXPECT_NEAR(Undistort(camera, {camera.cx + 1e5, camera.cy}).norm(), turn, 1e-3);
  EXPECT_TRUE(Undistort(camera, {kNan, 0}).allFinite());
}

TEST(CameraTest, FromFovSpansTheLongerSide) {
  for (const auto& [width, height] : {std::pair(1280, 720), std::pair(720, 1280)}) {
    const Camera camera = Camera::FromFov(width, height, 1.1);
    const bool wide = width > height;
    const Eigen::Vector2d first_edge = wide ? Eigen::Vector2d(-0.5, camera.cy)  //
                                            : Eigen::Vector2d(camera.cx, -0.5);
    const Eigen::Vector2d last_edge =
        wide ? Eigen::Vector2d(width - 0.5, camera.cy) : Eigen::Vector2d(camera.cx, height - 0.5);
    const double cos_angle = PixelRay(camera, first_edge).dot(PixelRay(camera, last_edge));
    EXPECT_NEAR(std::acos(cos_angle), 1.1, 1e-12);
  }
  EXPECT_MPC_ERROR(Camera::FromFov(0, 100, 1), kInvalidArgument, "size 0 x 100");
  EXPECT_MPC_ERROR(Camera::FromFov(100, 100, 0), kInvalidArgument, "field of view");
  EXPECT_MPC_ERROR(Camera::FromFov(100, 100, std::numbers::pi), kInvalidArgument, "field of view");
  EXPECT_MPC_ERROR(Camera::FromFov(100, 100, kNan), kInvalidArgument, "field of view");
}

TEST(CameraTest, ScaledCameraSeesTheSameRays) {
  const Camera camera = DistortedCamera();
  const Camera half = camera.ScaledTo(960, 540);
  const Eigen::Vector3d x(0.4, 0.3, 1.5);
  Eigen::Vector2d pixel, half_pixel;
  ASSERT_TRUE(Project(camera, x, &pixel));
  ASSERT_TRUE(Project(half, x, &half_pixel));
  const Eigen::Vector2d half_a_pixel = Eigen::Vector2d::Constant(0.5);
  EXPECT_LT(((half_pixel + half_a_pixel) - 0.5 * (pixel + half_a_pixel)).norm(), 1e-9);
  EXPECT_MPC_ERROR(camera.ScaledTo(1080, 1920), kMismatch, "1080 x 1920");
  EXPECT_MPC_ERROR(camera.ScaledTo(0, 0), kMismatch, "aspect");
}

TEST(CameraTest, ValidateNamesEveryFault) {
  DistortedCamera().Validate();
  Camera camera = DistortedCamera();
  camera.width = -3;
  camera.fx = 0;
  camera.cy = kNan;
  camera.distortion[4] = kNan;
  camera.camera_from_world.rotation(0, 0) = 2;
  camera.camera_from_world.translation.x() = kNan;
  for (const char* fault : {"size -3", "focal", "principal", "distortion", "rotation", "transl"}) {
    EXPECT_MPC_ERROR(camera.Validate(), kInvalidArgument, fault);
  }
  camera = DistortedCamera();
  camera.camera_from_world.rotation = -Eigen::Matrix3d::Identity();
  EXPECT_MPC_ERROR(camera.Validate(), kInvalidArgument, "right-handed");
}

TEST(CameraTest, RayFrameTurnsTheOpticalAxisOntoTheRayByTheSmallestRotation) {
  std::mt19937 rng(4);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d ray(normal(rng), normal(rng), normal(rng));
    const Eigen::Matrix3d camera_from_ray = CameraFromRay(ray);
    const Eigen::Vector3d direction = ray.normalized();
    EXPECT_LT((camera_from_ray.col(2) - direction).norm(), 1e-12);
    EXPECT_LT((camera_from_ray * camera_from_ray.transpose() - Eigen::Matrix3d::Identity()).norm(),
              1e-12);
    // The smallest rotation turns by exactly the angle between the two directions.
    EXPECT_NEAR(LogSO3(camera_from_ray).norm(), std::acos(direction.z()), 1e-6);
  }
  EXPECT_LT((CameraFromRay({0, 0, 3}) - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_LT((CameraFromRay({0, 0, -1}).col(2) + Eigen::Vector3d::UnitZ()).norm(), 1e-12);
}

}  // namespace
}  // namespace mpc
