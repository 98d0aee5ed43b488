#include "mpc/render/boundary.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "mpc/render/raster.h"
#include "render/meshes.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using testing::Ball;
using testing::Joined;

class BoundaryTest : public ::testing::Test {
 protected:
  ModelBoundary Find(const TriangleMesh& mesh) { return Find(mesh, mesh.positions); }
  ModelBoundary Find(const TriangleMesh& bind, const Eigen::Matrix3Xf& positions) {
    const SurfaceTopology topology = SurfaceTopology::FromMesh(bind);
    ModelMask(camera_, positions, topology, &mask_);
    RasterBuffers buffers;
    RasterizeMesh(camera_, positions, bind.triangles, {}, &buffers);
    depth_ = buffers.depth;
    for (const bool drop_hidden : {false, true}) {
      const ModelBoundary expected =
          FindModelBoundary(camera_, positions, topology, mask_, drop_hidden ? depth_ : cv::Mat());
      const ModelBoundary drawn =
          DrawModelBoundary(camera_, positions, topology, drop_hidden, &drawn_buffers_);
      EXPECT_EQ(drawn.vertices, expected.vertices);
      EXPECT_LT((drawn.pixels - expected.pixels).norm(), 1e-9);
      EXPECT_LT((drawn.normals - expected.normals).norm(), 1e-9);
    }
    return FindModelBoundary(camera_, positions, topology, mask_, depth_);
  }
  // Distance of a pixel from the outline of a ball: the angle between the ray and the tangent cone.
  double FromRim(const Eigen::Vector2d& pixel, const Eigen::Vector3d& centre, double radius) const {
    const double angle = std::acos(PixelRay(camera_, pixel).dot(centre.normalized()));
    return (angle - std::asin(radius / centre.norm())) * camera_.fx;
  }
  Camera camera_ = Camera::FromFov(640, 480, 1);
  cv::Mat mask_, depth_;
  BoundaryBuffers drawn_buffers_;  // of all meshes in turn: what is left in it means nothing
};

TEST_F(BoundaryTest, ABallHasItsTangentConeAsBoundary) {
  const double radius = 0.8;
  for (const Eigen::Vector3d& centre : {Eigen::Vector3d(0, 0, 3), {0.6, -0.2, 3}}) {
    const ModelBoundary boundary = Find(Ball(centre, radius, 120, 160));
    ASSERT_GT(boundary.vertices.size(), 150u);
    ASSERT_EQ(boundary.pixels.cols(), static_cast<Eigen::Index>(boundary.vertices.size()));
    ASSERT_EQ(boundary.normals.cols(), boundary.pixels.cols());
    Eigen::VectorXi sectors = Eigen::VectorXi::Zero(36);
    Eigen::Vector2d middle;
    ASSERT_TRUE(Project(camera_, centre, &middle));
    for (Eigen::Index i = 0; i < boundary.pixels.cols(); ++i) {
      const Eigen::Vector2d pixel = boundary.pixels.col(i), normal = boundary.normals.col(i);
      EXPECT_NEAR(FromRim(pixel, centre, radius), 0, 1);
      EXPECT_NEAR(normal.norm(), 1, 1e-9);
      // Across the rim: a step along the normal leaves the cone, a step to the side does not.
      const double step = 0.5;
      const Eigen::Vector2d side(-normal.y(), normal.x());
      const double out = FromRim(pixel + step * normal, centre, radius) -
                         FromRim(pixel - step * normal, centre, radius);
      const double along = FromRim(pixel + step * side, centre, radius) -
                           FromRim(pixel - step * side, centre, radius);
      EXPECT_GT(out, 0.7);  // a pixel far from the middle spans a smaller angle
      EXPECT_LT(std::abs(along), 0.06);
      const double angle = std::atan2(pixel.y() - middle.y(), pixel.x() - middle.x());
      ++sectors[static_cast<int>((angle + M_PI) / (2 * M_PI) * 35.999)];
    }
    EXPECT_GT(sectors.minCoeff(), 0) << sectors.transpose();
  }
}

TEST_F(BoundaryTest, NormalsFollowLensDistortion) {
  camera_.distortion = {-0.25, 0.08, 0.002, -0.002, 0};
  const Eigen::Vector3d centre(0.7, -0.5, 3);
  const ModelBoundary boundary = Find(Ball(centre, 0.6, 120, 160));
  ASSERT_GT(boundary.vertices.size(), 100u);
  for (Eigen::Index i = 0; i < boundary.pixels.cols(); ++i) {
    const Eigen::Vector2d normal = boundary.normals.col(i);
    const Eigen::Vector2d side(-normal.y(), normal.x());
    const Eigen::Vector2d pixel = boundary.pixels.col(i);
    EXPECT_LT(std::abs(FromRim(pixel + side, centre, 0.6) - FromRim(pixel - side, centre, 0.6)),
              0.1);
  }
}

TEST_F(BoundaryTest, OutlinesInsideTheMaskDoNotCount) {
  // A small ball before a large one; and one that sticks out.
  const TriangleMesh large = Ball({0, 0, 4}, 1);
  const int num_large = static_cast<int>(large.positions.cols());
  ModelBoundary boundary = Find(Joined(large, Ball({0, 0, 2.5}, 0.2)));
  ASSERT_GT(boundary.vertices.size(), 80u);
  for (const int v : boundary.vertices) EXPECT_LT(v, num_large);

  const Eigen::Vector3d front(0.75, 0, 2.6);
  boundary = Find(Joined(large, Ball(front, 0.3)));
  int of_front = 0;
  for (Eigen::Index i = 0; i < boundary.pixels.cols(); ++i) {
    const bool is_front = boundary.vertices[static_cast<size_t>(i)] >= num_large;
    of_front += is_front;
    const double other = is_front ? FromRim(boundary.pixels.col(i), {0, 0, 4}, 1)
                                  : FromRim(boundary.pixels.col(i), front, 0.3);
    EXPECT_GT(other, -1.6) << "inside the other ball's disc";
  }
  EXPECT_GT(of_front, 20);
  EXPECT_GT(static_cast<int>(boundary.vertices.size()) - of_front, 40);
}

TEST_F(BoundaryTest, WhatLiesHiddenBehindTheOutlineDoesNotCount) {
  // Two balls with nearly the same outline, the farther one a trace smaller.
  const TriangleMesh front = Ball({0, 0, 2}, 0.5);
  const TriangleMesh both = Joined(front, Ball({0, 0, 6}, 1.495));
  const ModelBoundary boundary = Find(both);
  ASSERT_GT(boundary.vertices.size(), 50u);
  for (const int v : boundary.vertices) EXPECT_LT(v, front.positions.cols());
  // Without depth they cannot be told apart.
  const ModelBoundary without =
      FindModelBoundary(camera_, both.positions, SurfaceTopology::FromMesh(both), mask_, cv::Mat());
  EXPECT_GT(without.vertices.size(), boundary.vertices.size() + 20);
}

TEST_F(BoundaryTest, OutlinesJustInsideTheMaskDoNotCount) {
  // The nearer ball's outline runs 1.9 px inside the farther one's.
  const double angle = std::asin(0.25);
  const TriangleMesh front = Ball({0, 0, 2}, 0.5, 120, 160);
  const double wider = std::sin(std::atan(std::tan(angle) + 1.9 / camera_.fx));
  const ModelBoundary boundary = Find(Joined(front, Ball({0, 0, 6}, 6 * wider, 120, 160)));
  ASSERT_GT(boundary.vertices.size(), 100u);
  size_t of_front = 0;
  for (const int v : boundary.vertices) of_front += v < front.positions.cols();
  EXPECT_LT(of_front, boundary.vertices.size() / 10);
}

TEST_F(BoundaryTest, ThePicturesBorderIsNoBoundary) {
  const Eigen::Vector3d centre(-1.6, 0, 3);
  const ModelBoundary boundary = Find(Ball(centre, 0.8, 120, 160));
  ASSERT_GT(boundary.vertices.size(), 30u);
  for (Eigen::Index i = 0; i < boundary.pixels.cols(); ++i) {
    EXPECT_NEAR(FromRim(boundary.pixels.col(i), centre, 0.8), 0, 1);
    EXPECT_GT(boundary.pixels(0, i), -0.5);
  }
  // A ball that covers the whole picture has none at all.
  EXPECT_TRUE(Find(Ball({0, 0, 2}, 1.9)).vertices.empty());
}

TEST_F(BoundaryTest, NothingToSee) {
  EXPECT_TRUE(Find(TriangleMesh{}).vertices.empty());
  EXPECT_TRUE(Find(Ball({0, 0, -3}, 0.8)).vertices.empty());
  EXPECT_TRUE(Find(Ball({50, 0, 3}, 0.8)).vertices.empty());
  EXPECT_EQ(Find(TriangleMesh{}).pixels.cols(), 0);
}

TEST_F(BoundaryTest, AroundTheCameraAndNonFinite) {
  // Parts behind the camera and broken vertices must not break the rest.
  TriangleMesh mesh = Joined(Ball({0, 0, 3}, 0.5), Ball({0, 5, 0}, 1));
  Eigen::Matrix3Xf positions = mesh.positions;
  for (int v = 0; v < 4000; v += 10) positions(1, v) = std::numeric_limits<float>::quiet_NaN();
  const ModelBoundary boundary = Find(mesh, positions);
  EXPECT_GT(boundary.vertices.size(), 20u);
  EXPECT_TRUE(boundary.pixels.allFinite());
  EXPECT_TRUE(boundary.normals.allFinite());
}

TEST_F(BoundaryTest, OpenEdgesPointOutOfTheSurface) {
  // A sheet that faces the camera: all of its boundary is open.
  const int n = 20;
  TriangleMesh sheet;
  sheet.positions.resize(3, n * n);
  sheet.triangles.resize(3, 2 * (n - 1) * (n - 1));
  int t = 0;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const int v = y * n + x;
      sheet.positions.col(v) << 0.1f * static_cast<float>(x) - 0.95f,
          0.1f * static_cast<float>(y) - 0.95f, 4;
      if (x + 1 == n || y + 1 == n) continue;
      sheet.triangles.col(t++) << v, v + n, v + 1;
      sheet.triangles.col(t++) << v + 1, v + n, v + n + 1;
    }
  }
  for (const bool turned : {false, true}) {
    if (turned) sheet.triangles.row(1).swap(sheet.triangles.row(2));
    const ModelBoundary boundary = Find(sheet);
    ASSERT_EQ(boundary.vertices.size(), 4u * (n - 1));
    for (Eigen::Index i = 0; i < boundary.pixels.cols(); ++i) {
      const int v = boundary.vertices[static_cast<size_t>(i)];
      const int x = v % n, y = v / n;
      const Eigen::Vector2d outward =
          Eigen::Vector2d((x == n - 1) - (x == 0), (y == n - 1) - (y == 0)).normalized();
      EXPECT_GT(boundary.normals.col(i).dot(outward), 0.999) << x << " " << y;
    }
  }
}

TEST_F(BoundaryTest, InsideOutSurfacesStillPointOut) {
  TriangleMesh mesh = Ball({0, 0, 3}, 0.8);
  mesh.triangles.row(1).swap(mesh.triangles.row(2));
  const ModelBoundary boundary = Find(mesh);
  ASSERT_GT(boundary.vertices.size(), 80u);
  Eigen::Vector2d middle;
  ASSERT_TRUE(Project(camera_, {0, 0, 3}, &middle));
  for (Eigen::Index i = 0; i < boundary.pixels.cols(); ++i) {
    EXPECT_GT(boundary.normals.col(i).dot((boundary.pixels.col(i) - middle).normalized()), 0.95);
  }
}

TEST_F(BoundaryTest, SeamVerticesAppearOnce) {
  // The two halves of a ball, each with its own copy of the vertices along the cut.
  TriangleMesh ball = Ball({0, 0, 3}, 0.8);
  const size_t whole = Find(ball).vertices.size();
  const Eigen::Index half = ball.triangles.cols() / 2;
  TriangleMesh seamed;
  seamed.positions.resize(3, 2 * ball.positions.cols());
  seamed.positions << ball.positions, ball.positions;
  seamed.triangles = ball.triangles;
  seamed.triangles.rightCols(half).array() += static_cast<int>(ball.positions.cols());
  const ModelBoundary boundary = Find(seamed);
  EXPECT_EQ(boundary.vertices.size(), whole);
  for (const int v : boundary.vertices) EXPECT_LT(v, ball.positions.cols());
}

TEST_F(BoundaryTest, ShortNormalsAreLeftOut) {
  const TriangleMesh mesh = Ball({0, 0, 3}, 0.8);
  const SurfaceTopology topology = SurfaceTopology::FromMesh(mesh);
  Find(mesh);
  BoundaryOptions options;
  options.min_projected_normal = 1.01;
  EXPECT_TRUE(FindModelBoundary(camera_, mesh.positions, topology, mask_, depth_, options)
                  .vertices.empty());
}

TEST_F(BoundaryTest, SmallAndLargePictures) {
  const TriangleMesh mesh = Ball({0, 0, 3}, 0.8);
  camera_ = Camera::FromFov(64, 64, 1);
  EXPECT_GT(Find(mesh).vertices.size(), 50u);
  camera_ = Camera::FromFov(3840, 2160, 1);
  EXPECT_GT(Find(mesh).vertices.size(), 50u);
}

TEST_F(BoundaryTest, MisuseIsRefused) {
  const TriangleMesh mesh = Ball({0, 0, 3}, 0.8);
  const SurfaceTopology topology = SurfaceTopology::FromMesh(mesh);
  Find(mesh);
  EXPECT_MPC_ERROR(
      FindModelBoundary(camera_, mesh.positions, topology, cv::Mat(5, 4, CV_8UC1), depth_),
      kInvalidArgument, "4 x 5");
  EXPECT_MPC_ERROR(FindModelBoundary(camera_, mesh.positions, topology, mask_, mask_),
                   kInvalidArgument, "depth");
  EXPECT_MPC_ERROR(FindModelBoundary(camera_, mesh.positions.leftCols(3), topology, mask_, depth_),
                   kInvalidArgument, "3 positions");
}

}  // namespace
}  // namespace mpc
