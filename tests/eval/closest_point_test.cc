#include "mpc/eval/closest_point.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <random>
#include <vector>

#include "random_surface.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

TEST(TriangleDistance, EveryRegion) {
  const Vector3d a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  EXPECT_EQ(TriangleDistance({0.25, 0.25, -2}, a, b, c), 2);                     // inside
  EXPECT_EQ(TriangleDistance({-3, -4, 0}, a, b, c), 5);                          // a
  EXPECT_EQ(TriangleDistance({4, -4, 0}, a, b, c), 5);                           // b
  EXPECT_EQ(TriangleDistance({-3, 5, 0}, a, b, c), 5);                           // c
  EXPECT_EQ(TriangleDistance({0.5, -3, 4}, a, b, c), 5);                         // ab
  EXPECT_EQ(TriangleDistance({-3, 0.5, 4}, a, b, c), 5);                         // ac
  EXPECT_NEAR(TriangleDistance({1, 1, 0}, a, b, c), std::sqrt(0.5), 1e-15);      // bc
  EXPECT_NEAR(TriangleDistance({1.5, 1.5, 1}, a, b, c), std::sqrt(3.0), 1e-15);  // bc, above
}

TEST(TriangleDistance, IsExactlyZeroAtCorners) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    Eigen::Matrix3f x = Eigen::Matrix3f::NullaryExpr([&] { return float(normal(random)); });
    if (i % 4 == 1) x.col(2) = x.col(1);                     // a needle
    if (i % 4 == 2) x.col(2) = x.col(0) + 1e-6F * x.col(1);  // nearly one
    const Eigen::Matrix3d corners = x.cast<double>();
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(TriangleDistance(corners.col(k), corners.col(0), corners.col(1), corners.col(2)),
                0);
    }
  }
}

TEST(TriangleDistance, DegenerateTrianglesAreSegmentsAndPoints) {
  const Vector3d a(0, 0, 0), b(2, 0, 0);
  EXPECT_EQ(TriangleDistance({1, 3, 0}, a, b, b), 3);
  EXPECT_EQ(TriangleDistance({1, 3, 0}, b, a, b), 3);
  EXPECT_EQ(TriangleDistance({1, 3, 0}, a, a, b), 3);
  EXPECT_EQ(TriangleDistance({3, 4, 0}, a, a, a), 5);
}

TEST(SurfaceTree, AgreesWithBruteForce) {
  for (const int num_triangles : {1, 2, 5, 300}) {
    testing::RandomSurface surface(num_triangles, /*seed=*/num_triangles);
    const SurfaceTree tree(surface.positions, surface.triangles);
    int hint = 0;
    for (int i = 0; i < 300; ++i) {
      const Vector3d point = (i % 3 == 0 ? 5.0 : 1.0) * surface.RandomPoint();
      double nearest = std::numeric_limits<double>::infinity();
      for (const auto& t : surface.triangles.colwise()) {
        nearest =
            std::min(nearest, TriangleDistance(point, surface.positions.col(t[0]).cast<double>(),
                                               surface.positions.col(t[1]).cast<double>(),
                                               surface.positions.col(t[2]).cast<double>()));
      }
      EXPECT_NEAR(tree.Distance(point), nearest, 1e-14);
      EXPECT_NEAR(tree.Distance(point, &hint), nearest, 1e-14);
      const auto& found = surface.triangles.col(hint);
      EXPECT_NEAR(TriangleDistance(point, surface.positions.col(found[0]).cast<double>(),
                                   surface.positions.col(found[1]).cast<double>(),
                                   surface.positions.col(found[2]).cast<double>()),
                  nearest, 1e-14);
    }
  }
}

TEST(SurfaceTree, ManyTrianglesInOnePlaceDoNotHang) {
  const Eigen::Matrix3Xf positions = Eigen::Matrix3Xf::Zero(3, 3);
  const Triangles triangles = Eigen::Vector3i(0, 1, 2).replicate(1, 5000);
  EXPECT_EQ(SurfaceTree(positions, triangles).Distance({3, 4, 0}), 5);
}

TEST(SurfaceTree, RefusesWhatIsNoSurface) {
  const Eigen::Matrix3Xf positions = Eigen::Matrix3Xf::Random(3, 3);
  EXPECT_MPC_ERROR(SurfaceTree(positions, Triangles(3, 0)), kInvalidArgument, "without triangles");
  EXPECT_MPC_ERROR(SurfaceTree(positions, Eigen::Vector3i(0, 1, 3)), kInvalidArgument, "");
  Eigen::Matrix3Xf broken = positions;
  broken(1, 1) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_MPC_ERROR(SurfaceTree(broken, Eigen::Vector3i(0, 1, 2)), kInvalidArgument, "");
}

}  // namespace
}  // namespace mpc
