// The fast kernel against the plain one, and the mask drawn by outlines against the mask drawn by
// triangles: bit for bit.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cstring>
#include <limits>
#include <random>

#include "mpc/render/model_mask.h"
#include "mpc/render/raster.h"
#include "render/meshes.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using testing::Ball;
using testing::Joined;
using testing::Tangle;

bool SameBits(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y) {
    if (std::memcmp(a.ptr(y), b.ptr(y), static_cast<size_t>(a.cols) * a.elemSize()) != 0) {
      return false;
    }
  }
  return true;
}

class TwinTest : public ::testing::Test {
 protected:
  // Draws all three ways; returns the number of pixels covered.
  int Check(const Camera& camera, const TriangleMesh& mesh) {
    return Check(camera, mesh, mesh.positions);
  }
  int Check(const Camera& camera, const TriangleMesh& bind, const Eigen::Matrix3Xf& positions) {
    RasterizeMesh(camera, positions, bind.triangles, {}, &fast_);
    RasterizeMeshScalar(camera, positions, bind.triangles, {}, &plain_);
    EXPECT_TRUE(SameBits(fast_.depth, plain_.depth));
    EXPECT_TRUE(SameBits(fast_.triangle_id, plain_.triangle_id));
    ModelMask(camera, positions, SurfaceTopology::FromMesh(bind), &mask_);
    EXPECT_TRUE(SameBits(mask_, plain_.triangle_id >= 0));
    EXPECT_TRUE(SameBits(mask_, MeshMask(camera, positions, bind.triangles)));
    return cv::countNonZero(mask_);
  }
  std::mt19937_64 random_{11};
  RasterBuffers fast_, plain_;
  cv::Mat mask_;
};

TEST_F(TwinTest, TanglesOfAllSizesOfTriangle) {
  for (const double spread : {0.01, 0.03, 0.1, 0.5, 3.0}) {
    for (int round = 0; round < 8; ++round) {
      const TriangleMesh mesh = Tangle(60, 80, spread, {0.1, 0, 2.5}, &random_);
      EXPECT_GT(Check(Camera::FromFov(320, 200, 1), mesh), 0) << spread;
    }
  }
}

TEST_F(TwinTest, TinyAndOddPictures) {
  for (const auto& [width, height] :
       {std::pair(1, 1), {3, 5}, {7, 200}, {9, 9}, {67, 3}, {71, 71}}) {
    const Camera camera = Camera::FromFov(width, height, 1);
    for (int round = 0; round < 5; ++round) {
      Check(camera, Tangle(30, 40, 0.6, {0, 0, 2}, &random_));
    }
    EXPECT_EQ(Check(camera, Ball({0, 0, 2}, 1.9)), width * height);
  }
}

TEST_F(TwinTest, TrianglesThroughTheNearPlaneAndFarOutside) {
  for (int round = 0; round < 20; ++round) {
    Check(Camera::FromFov(160, 120, 1.5), Tangle(30, 30, 2, {0, 0, 0.5}, &random_));
    Check(Camera::FromFov(160, 120, 1.5), Tangle(30, 30, 1e7, {0, 0, 1e6}, &random_));
  }
  EXPECT_EQ(Check(Camera::FromFov(160, 120, 1), Ball({0, 0, 0}, 1)), 160 * 120)
      << "seen from inside";
}

TEST_F(TwinTest, LensDistortion) {
  Camera camera = Camera::FromFov(320, 200, 1);
  camera.distortion = {-0.25, 0.08, 0.001, -0.002, 0.01};
  EXPECT_GT(Check(camera, Tangle(60, 80, 0.4, {0, 0, 2}, &random_)), 0);
}

TEST_F(TwinTest, VerticesOnPixelCentresAndEdges) {
  for (const int side : {40, 300}) {
    std::uniform_int_distribution<int> half_pixel(0, 2 * side);
    Camera camera = Camera::FromFov(side, side, 1);
    camera.fx = camera.fy = 32;  // exact in binary
    camera.cx = camera.cy = 0;
    for (int round = 0; round < 60; ++round) {
      TriangleMesh mesh = Tangle(12, 12, 1, {0, 0, 2}, &random_);
      for (int v = 0; v < 12; ++v) {
        const float z = v % 2 == 0 ? 1 : 2;
        mesh.positions.col(v) << z * static_cast<float>(half_pixel(random_)) / 64,
            z * static_cast<float>(half_pixel(random_)) / 64, z;
      }
      Check(camera, mesh);
    }
  }
}

TEST_F(TwinTest, NonFiniteVertices) {
  TriangleMesh mesh = Ball({0, 0, 3}, 1);
  const Camera camera = Camera::FromFov(200, 200, 1);
  const int whole = Check(camera, mesh);
  Eigen::Matrix3Xf broken = mesh.positions;
  for (int v = 0; v < broken.cols(); v += 7) {
    broken(v % 3, v) = v % 2 == 0 ? std::numeric_limits<float>::quiet_NaN()
                                  : -std::numeric_limits<float>::infinity();
  }
  const int holed = Check(camera, mesh, broken);
  EXPECT_GT(holed, 0);
  EXPECT_LT(holed, whole);
}

TEST_F(TwinTest, PartlyAndWhollyOutsideThePicture) {
  const Camera camera = Camera::FromFov(200, 100, 1);
  EXPECT_GT(Check(camera, Ball({-1.2, 0.5, 3}, 0.5)), 0);
  EXPECT_EQ(Check(camera, Ball({9, 0, 3}, 0.5)), 0);
  EXPECT_EQ(Check(camera, Ball({0, 0, -3}, 0.5)), 0);
  EXPECT_EQ(Check(camera, TriangleMesh{}), 0);
}

TEST_F(TwinTest, LargePicturesAndManyTriangles) {
  const TriangleMesh mesh = Joined(Ball({0.2, 0, 3}, 0.8), Ball({-0.5, 0.1, 2.5}, 0.4));
  EXPECT_GT(Check(Camera::FromFov(3840, 2160, 1.2), mesh), 1000000);
  EXPECT_GT(Check(Camera::FromFov(64, 64, 1.2), mesh), 500);
}

TEST_F(TwinTest, DepthOfTheNearestTriangleAgainstGeometry) {
  // Rays through pixel centres against the triangles themselves, away from edges.
  const Camera camera = Camera::FromFov(120, 90, 1);
  const TriangleMesh mesh = Tangle(30, 12, 0.5, {0, 0, 3}, &random_);
  Check(camera, mesh);
  int compared = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = Undistort(camera, Eigen::Vector2d(x, y)).homogeneous();
      double nearest = std::numeric_limits<double>::infinity();
      bool near_edge = false;
      for (int t = 0; t < mesh.triangles.cols(); ++t) {
        const Eigen::Matrix3d corners =
            mesh.positions(Eigen::all, mesh.triangles.col(t)).cast<double>();
        const Eigen::Vector3d weights = corners.inverse() * ray;
        near_edge |= std::abs(weights.minCoeff()) < 0.03 * weights.maxCoeff();
        if (weights.minCoeff() > 0) nearest = std::min(nearest, 1 / weights.sum());
      }
      if (near_edge) continue;
      ++compared;
      const float depth = plain_.depth.at<float>(y, x);
      if (std::isinf(nearest)) {
        EXPECT_EQ(depth, 0);
      } else {
        EXPECT_NEAR(depth, nearest, 0.01 * nearest);
      }
    }
  }
  EXPECT_GT(compared, 2000);
}

TEST(SurfaceTopologyTest, EdgesOfAClosedBall) {
  const TriangleMesh ball = Ball({0, 0, 3}, 1, 5, 8);
  const SurfaceTopology topology = SurfaceTopology::FromMesh(ball);
  // Euler: V - E + T = 2.
  EXPECT_EQ(static_cast<int>(topology.edges.size()), 42 + ball.triangles.cols() - 2);
  for (const SurfaceTopology::Edge& edge : topology.edges) {
    ASSERT_GE(edge.side1, 0);
    EXPECT_NE(edge.side0 % 2, edge.side1 % 2) << "neighbours take an edge in opposite directions";
    for (const int side : {edge.side0, edge.side1}) {
      const Eigen::Vector3i corner = topology.triangles.col(side / 2);
      EXPECT_TRUE((corner.array() == edge.v0).any() && (corner.array() == edge.v1).any());
    }
  }
  for (int v = 0; v < 42; ++v) {
    for (int i = topology.vertex_begin[v]; i < topology.vertex_begin[v + 1]; ++i) {
      EXPECT_TRUE((topology.triangles.col(topology.vertex_triangles[i]).array() == v).any());
    }
  }
  EXPECT_EQ(static_cast<Eigen::Index>(topology.vertex_triangles.size()), ball.triangles.size());
}

TEST(SurfaceTopologyTest, SeamsAreWelded) {
  TriangleMesh mesh;
  mesh.positions.resize(3, 6);
  mesh.positions << 0, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 1, 1, 1, 1, 1, 1, 1;
  mesh.triangles.resize(3, 2);
  mesh.triangles << 0, 3, 1, 4, 2, 5;
  const SurfaceTopology topology = SurfaceTopology::FromMesh(mesh);
  EXPECT_EQ(topology.edges.size(), 5u);
  EXPECT_EQ(topology.triangles.col(1), Eigen::Vector3i(2, 1, 5));
}

TEST(SurfaceTopologyTest, MisuseIsRefused) {
  TriangleMesh mesh = Ball({0, 0, 3}, 1, 5, 8);
  const SurfaceTopology topology = SurfaceTopology::FromMesh(mesh);
  cv::Mat mask;
  const Camera camera = Camera::FromFov(20, 20, 1);
  EXPECT_MPC_ERROR(ModelMask(camera, mesh.positions.leftCols(7), topology, &mask), kInvalidArgument,
                   "7 positions for a topology of 42");
  mesh.triangles(0, 0) = 42;
  EXPECT_MPC_ERROR(SurfaceTopology::FromMesh(mesh), kInvalidArgument, "42");
}

}  // namespace
}  // namespace mpc
