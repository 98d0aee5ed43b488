#include "mpc/render/raster.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "support/expect_error.h"

namespace mpc {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Camera PixelCamera(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 100;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

// Vertices that project to given pixels at given depths.
Eigen::Matrix3Xf AtPixels(const Camera& camera, const std::vector<Eigen::Vector3d>& pixel_depth) {
  Eigen::Matrix3Xf positions(3, static_cast<Eigen::Index>(pixel_depth.size()));
  for (size_t i = 0; i < pixel_depth.size(); ++i) {
    const Eigen::Vector3d& p = pixel_depth[i];
    positions.col(static_cast<Eigen::Index>(i)) =
        Eigen::Vector3d((p.x() - camera.cx) / camera.fx * p.z(),
                        (p.y() - camera.cy) / camera.fy * p.z(), p.z())
            .cast<float>();
  }
  return positions;
}

Triangles Faces(const std::vector<Eigen::Vector3i>& faces) {
  Triangles triangles(3, static_cast<Eigen::Index>(faces.size()));
  for (size_t i = 0; i < faces.size(); ++i) {
    triangles.col(static_cast<Eigen::Index>(i)) = faces[i];
  }
  return triangles;
}

int Covered(const RasterBuffers& buffers) { return cv::countNonZero(buffers.triangle_id >= 0); }

class RasterTest : public ::testing::Test {
 protected:
  void Draw(const Eigen::Matrix3Xf& positions, const std::vector<Eigen::Vector3i>& faces) {
    RasterizeMesh(camera_, positions, Faces(faces), options_, &buffers_);
  }
  Camera camera_ = PixelCamera(64, 48);
  RasterOptions options_;
  RasterBuffers buffers_;
};

TEST_F(RasterTest, TrianglesWithACommonEdgeCoverEachPixelOnce) {
  // Vertices on whole and half pixels make the edges run through pixel centres.
  std::mt19937_64 random(7);
  std::uniform_int_distribution<int> x(0, 126), y(0, 94);
  for (int round = 0; round < 300; ++round) {
    // A fan around a point: a full turn of triangles, each drawn alone.
    const Eigen::Vector3d centre(0.5 * x(random), 0.5 * y(random), 2);
    std::vector<Eigen::Vector3d> points = {
        centre, {-9, -9, 2}, {80, -9, 2}, {80, 60, 2}, {-9, 60, 2}};
    const Eigen::Matrix3Xf positions = AtPixels(camera_, points);
    cv::Mat count = cv::Mat::zeros(48, 64, CV_32S);
    const std::vector<Eigen::Vector3i> faces = {{0, 1, 2}, {0, 3, 2}, {3, 4, 0}, {1, 0, 4}};
    for (const Eigen::Vector3i& face : faces) {
      Draw(positions, {face});
      count += cv::Mat(buffers_.triangle_id >= 0) / 255;
    }
    double least = 0, most = 0;
    cv::minMaxLoc(count, &least, &most);
    ASSERT_EQ(least, 1) << "round " << round;
    ASSERT_EQ(most, 1) << "round " << round;
  }
}

TEST_F(RasterTest, AreaOfASquare) {
  // From -0.5 to 19.5 covers exactly the pixels 0 to 19.
  Draw(AtPixels(camera_, {{-0.5, -0.5, 3}, {19.5, -0.5, 3}, {19.5, 9.5, 3}, {-0.5, 9.5, 3}}),
       {{0, 1, 2}, {0, 2, 3}});
  EXPECT_EQ(Covered(buffers_), 200);
  EXPECT_EQ(buffers_.triangle_id.at<int>(9, 19) >= 0, true);
  EXPECT_EQ(buffers_.triangle_id.at<int>(10, 5), -1);
  EXPECT_EQ(buffers_.depth.at<float>(10, 5), 0);
}

TEST_F(RasterTest, AreaOfAManySidedShapeIsItsArea) {
  camera_ = PixelCamera(400, 400);
  std::vector<Eigen::Vector3d> points = {{200.3, 199.8, 2}};
  std::vector<Eigen::Vector3i> faces;
  const int sides = 60;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * M_PI * i / sides;
    points.push_back({200.3 + 150 * std::cos(angle), 199.8 + 150 * std::sin(angle), 2});
    faces.push_back({0, 1 + i, 1 + (i + 1) % sides});
  }
  Draw(AtPixels(camera_, points), faces);
  const double area = 0.5 * sides * 150 * 150 * std::sin(2 * M_PI / sides);
  EXPECT_NEAR(Covered(buffers_), area, 0.002 * area);
}

TEST_F(RasterTest, DepthOfATiltedPlaneIsPerspectiveCorrect) {
  // The plane n . x = d with corners at different depths.
  const std::vector<Eigen::Vector3d> corners = {{-20, -20, 1.0}, {90, -20, 6.0}, {40, 80, 2.5}};
  const Eigen::Matrix3Xf positions = AtPixels(camera_, corners);
  const Eigen::Vector3d a = positions.col(0).cast<double>();
  const Eigen::Vector3d normal =
      (positions.col(1).cast<double>() - a).cross(positions.col(2).cast<double>() - a);
  options_.barycentric = true;
  Draw(positions, {{0, 1, 2}});
  ASSERT_GT(Covered(buffers_), 1000);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      if (buffers_.triangle_id.at<int>(y, x) < 0) continue;
      const Eigen::Vector3d ray = PixelRay(camera_, {x, y});
      const Eigen::Vector3d hit = ray * normal.dot(a) / normal.dot(ray);
      EXPECT_NEAR(buffers_.depth.at<float>(y, x), hit.z(), 2e-3);
      const cv::Vec2f w = buffers_.barycentric.at<cv::Vec2f>(y, x);
      const Eigen::Vector3f x_from_weights =
          positions.col(0) * w[0] + positions.col(1) * w[1] + positions.col(2) * (1 - w[0] - w[1]);
      EXPECT_LT((x_from_weights.cast<double>() - hit).norm(), 0.02);
    }
  }
}

TEST_F(RasterTest, TheNearerTriangleWinsInAnyOrder) {
  const Eigen::Matrix3Xf positions =
      AtPixels(camera_, {{0, 0, 3}, {60, 0, 3}, {0, 40, 3}, {0, 0, 2}, {60, 0, 2}, {0, 40, 2}});
  Draw(positions, {{0, 1, 2}, {3, 4, 5}});
  EXPECT_EQ(buffers_.triangle_id.at<int>(5, 5), 1);
  EXPECT_FLOAT_EQ(buffers_.depth.at<float>(5, 5), 2);
  Draw(positions, {{5, 4, 3}, {0, 1, 2}});
  EXPECT_EQ(buffers_.triangle_id.at<int>(5, 5), 0);
  Draw(positions, {{0, 1, 2}, {2, 1, 0}});
  EXPECT_EQ(buffers_.triangle_id.at<int>(5, 5), 0) << "of equally near ones the first";
}

TEST_F(RasterTest, AFloorThroughTheNearPlaneFillsTheLowerHalf) {
  // A floor one metre below the camera, reaching from far behind it to the horizon.
  Eigen::Matrix3Xf floor(3, 4);
  floor << -1e4f, 1e4f, 1e4f, -1e4f, 1, 1, 1, 1, -1e4f, -1e4f, 1e4f, 1e4f;
  Draw(floor, {{0, 1, 2}, {0, 2, 3}});
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const double below = y - camera_.cy;
      if (std::abs(below) < 1) continue;
      ASSERT_EQ(buffers_.triangle_id.at<int>(y, x) >= 0, below > 0) << x << " " << y;
      if (below > 0) {
        ASSERT_NEAR(buffers_.depth.at<float>(y, x), camera_.fy / below, 0.01 * camera_.fy / below);
      }
    }
  }
}

TEST_F(RasterTest, ClippedNeighboursStillCoverEachPixelOnce) {
  // Two triangles that share an edge through the near plane, drawn alone.
  Eigen::Matrix3Xf positions(3, 4);
  positions << -0.05f, 0.3f, -3, 4, 0.01f, 0.4f, 2, -2, -1, 3, 2, 2;
  Draw(positions, {{0, 1, 2}});
  const cv::Mat first = buffers_.triangle_id >= 0;
  Draw(positions, {{1, 0, 3}});
  const cv::Mat second = buffers_.triangle_id >= 0;
  EXPECT_GT(cv::countNonZero(first), 100);
  EXPECT_GT(cv::countNonZero(second), 100);
  EXPECT_EQ(cv::countNonZero(first & second), 0);
}

TEST_F(RasterTest, WhatLiesBehindTheCameraIsNotDrawn) {
  Eigen::Matrix3Xf positions = AtPixels(camera_, {{0, 0, 2}, {60, 0, 2}, {0, 40, 2}});
  positions *= -1;
  Draw(positions, {{0, 1, 2}});
  EXPECT_EQ(Covered(buffers_), 0);
  positions = AtPixels(camera_, {{0, 0, 0.005}, {60, 0, 0.005}, {0, 40, 0.005}});
  Draw(positions, {{0, 1, 2}});
  EXPECT_EQ(Covered(buffers_), 0);
}

TEST_F(RasterTest, DegenerateAndNonFiniteTrianglesAreLeftOut) {
  Eigen::Matrix3Xf positions = AtPixels(
      camera_, {{5, 5, 2}, {50, 40, 2}, {5, 5, 2}, {27.5, 22.5, 2}, {50, 5, 2}, {5, 40, 2}});
  Draw(positions, {{0, 0, 0}, {0, 1, 2}, {0, 3, 1}});
  EXPECT_EQ(Covered(buffers_), 0);
  positions(1, 4) = kNan;
  positions(2, 5) = std::numeric_limits<float>::infinity();
  Draw(positions, {{0, 1, 4}, {0, 1, 5}});
  EXPECT_EQ(Covered(buffers_), 0);
  EXPECT_TRUE(ProjectedBounds(camera_, Eigen::Matrix3Xf::Constant(3, 4, kNan)).empty());
}

TEST_F(RasterTest, HugeTrianglesAreCutNotDropped) {
  Eigen::Matrix3Xf positions(3, 3);
  positions << -1e7f, 1e7f, 0, -1e7f, -1e7f, 1e8f, 0.02f, 0.02f, 0.02f;
  Draw(positions, {{0, 1, 2}});
  EXPECT_EQ(Covered(buffers_), 64 * 48);
}

TEST_F(RasterTest, APictureOfOnePixel) {
  camera_ = PixelCamera(1, 1);
  Draw(AtPixels(camera_, {{-3, -3, 2}, {5, -3, 2}, {-3, 5, 2}}), {{0, 1, 2}});
  EXPECT_EQ(Covered(buffers_), 1);
  Draw(AtPixels(camera_, {{0.1, -3, 2}, {5, -3, 2}, {5, 5, 2}}), {{0, 1, 2}});
  EXPECT_EQ(Covered(buffers_), 0);
}

TEST_F(RasterTest, LensDistortionMovesVertices) {
  camera_.distortion = {-0.2, 0.05, 0.002, -0.001, 0.01};
  Eigen::Matrix3Xf positions(3, 3);
  positions << 0.3f, 0.31f, 0.3f, 0.2f, 0.2f, 0.21f, 1, 1, 1;
  // Far enough apart for one whole pixel around the projection of (0.303, 0.203).
  positions.col(1) += Eigen::Vector3f(0.05f, 0, 0);
  positions.col(2) += Eigen::Vector3f(0, 0.05f, 0);
  Draw(positions, {{0, 1, 2}});
  Eigen::Vector2d pixel;
  ASSERT_TRUE(Project(camera_, positions.rowwise().mean().cast<double>(), &pixel));
  EXPECT_GE(buffers_.triangle_id.at<int>(static_cast<int>(std::lround(pixel.y())),
                                         static_cast<int>(std::lround(pixel.x()))),
            0);
}

TEST_F(RasterTest, MaskEqualsTheFullRasterAndCroppingChangesNothing) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> at(-0.6f, 0.6f);
  Eigen::Matrix3Xf positions(3, 60);
  for (int i = 0; i < 60; ++i) positions.col(i) << at(random), at(random), 2 + at(random);
  std::vector<Eigen::Vector3i> faces;
  for (int i = 0; i < 20; ++i) faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  Draw(positions, faces);
  const cv::Mat mask = MeshMask(camera_, positions, Faces(faces));
  EXPECT_EQ(cv::countNonZero(mask != (buffers_.triangle_id >= 0)), 0);
  EXPECT_GT(cv::countNonZero(mask), 100);

  const cv::Rect rect(10, 7, 30, 25);
  const cv::Mat whole = buffers_.triangle_id.clone();
  RasterizeMesh(CroppedTo(camera_, rect), positions, Faces(faces), options_, &buffers_);
  EXPECT_EQ(cv::countNonZero(whole(rect) != buffers_.triangle_id), 0);
}

TEST_F(RasterTest, MisuseIsRefused) {
  const Eigen::Matrix3Xf positions = Eigen::Matrix3Xf::Ones(3, 3);
  EXPECT_MPC_ERROR(Draw(positions, {{0, 1, 3}}), kInvalidArgument, "3");
  EXPECT_MPC_ERROR(Draw(positions, {{0, 1, -1}}), kInvalidArgument, "-1");
  EXPECT_MPC_ERROR(MeshMask(camera_, positions, Faces({{0, 1, 3}})), kInvalidArgument, "3");
  camera_.width = 20000;
  EXPECT_MPC_ERROR(Draw(positions, {{0, 1, 2}}), kInvalidArgument, "20000");
  camera_.width = 0;
  EXPECT_MPC_ERROR(Draw(positions, {{0, 1, 2}}), kInvalidArgument, "0");
}

TEST_F(RasterTest, EmptyMeshes) {
  Draw(Eigen::Matrix3Xf(3, 0), {});
  EXPECT_EQ(Covered(buffers_), 0);
  EXPECT_EQ(cv::countNonZero(MeshMask(camera_, Eigen::Matrix3Xf(3, 0), Triangles(3, 0))), 0);
  EXPECT_EQ(cv::countNonZero(CapsuleMask(camera_, {})), 0);
}

class CapsuleTest : public ::testing::Test {
 protected:
  Camera camera_ = PixelCamera(400, 300);
};

TEST_F(CapsuleTest, ASphereIsADiscOfTheRightSize) {
  camera_.fx = camera_.fy = 300;
  const double radius = 0.3;
  const cv::Mat mask = CapsuleMask(camera_, {{{0, 0, 2}, {0, 0, 2}, radius, radius}});
  const double disc = 300 * radius / std::sqrt(4 - radius * radius);
  EXPECT_NEAR(cv::countNonZero(mask), M_PI * disc * disc, 0.02 * M_PI * disc * disc);
}

TEST_F(CapsuleTest, CoversBothBallsAndTheTrapezoidBetween) {
  // Twin: the union of many spheres along the axis.
  for (const Capsule& capsule :
       {Capsule{{-0.5, -0.3, 2}, {0.6, 0.4, 2.5}, 0.2, 0.1},
        Capsule{{0, -0.5, 2}, {0, 0.5, 2}, 0.1, 0.1}, Capsule{{0, 0, 2}, {0.05, 0, 2}, 0.3, 0.1},
        Capsule{{0, 0, 2}, {0.05, 0.1, 2}, 0.05, 0.4}}) {
    CapsuleSet spheres;
    for (int i = 0; i <= 60; ++i) {
      const double s = i / 60.0;
      const Eigen::Vector3d x = (1 - s) * capsule.a + s * capsule.b;
      const double r = (1 - s) * capsule.radius_a + s * capsule.radius_b;
      spheres.push_back({x, x, r, r});
    }
    const cv::Mat a = CapsuleMask(camera_, {capsule});
    const cv::Mat b = CapsuleMask(camera_, spheres);
    EXPECT_LT(cv::countNonZero(a != b), 0.02 * cv::countNonZero(b));
  }
}

TEST_F(CapsuleTest, IdsAndDepthBelongToTheNearerCapsule) {
  RasterBuffers buffers;
  RasterizeCapsules(camera_, {{{-1, 0, 3}, {1, 0, 3}, 0.2, 0.2}, {{0, -1, 2}, {0, 1, 2}, 0.1, 0.1}},
                    {}, &buffers);
  EXPECT_EQ(buffers.triangle_id.at<int>(150, 200), 1);
  EXPECT_NEAR(buffers.depth.at<float>(150, 200), 1.9, 0.002);
  EXPECT_EQ(buffers.triangle_id.at<int>(150, 220), 0);
  EXPECT_EQ(buffers.triangle_id.at<int>(20, 20), -1);
}

TEST_F(CapsuleTest, NegativeRadiiAreRefused) {
  EXPECT_MPC_ERROR(CapsuleMask(camera_, {{{0, 0, 2}, {0, 1, 2}, 0.1, -1}}), kInvalidArgument, "-1");
}

}  // namespace
}  // namespace mpc
