#include "mpc/eval/surface_metrics.h"

#include <gtest/gtest.h>

#include "random_surface.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

// A square of 2 x 2 quads in the plane z = 0, between 0 and 2.
struct Plane {
  Plane() : positions(3, 9), triangles(3, 8) {
    for (int i = 0; i < 9; ++i) positions.col(i) << float(i % 3), float(i / 3), 0;
    int t = 0;
    for (const int corner : {0, 1, 3, 4}) {
      triangles.col(t++) << corner, corner + 1, corner + 4;
      triangles.col(t++) << corner, corner + 4, corner + 3;
    }
  }
  Eigen::Matrix3Xf positions;
  Triangles triangles;
};

TEST(SurfaceMetrics, TruthAgainstItselfIsExactlyZero) {
  const testing::RandomSurface surface(200, 7);
  const Vector3d offset = MeanOffset(surface.positions, surface.positions);
  EXPECT_EQ(offset, Vector3d::Zero());
  const SurfaceError error =
      CompareSurfaces(surface.positions, surface.positions, surface.triangles, offset);
  EXPECT_EQ(error.vertex_mm, 0);
  EXPECT_EQ(error.surface_mm, 0);
}

TEST(SurfaceMetrics, ATranslationIsFoundAndRemoved) {
  const Plane plane;
  const Eigen::Matrix3Xf moved = plane.positions.colwise() + Eigen::Vector3f(0.25F, 0.5F, -2);
  const Vector3d translation = MeanOffset(moved, plane.positions);
  EXPECT_EQ(translation, Vector3d(-0.25, -0.5, 2));
  EXPECT_EQ(MeanVertexDistanceMm(moved, plane.positions, translation), 0);
  EXPECT_EQ(CompareSurfaces(moved, plane.positions, plane.triangles, translation).surface_mm, 0);
}

TEST(SurfaceMetrics, SlidingInThePlaneIsSeenByVerticesOnly) {
  const Plane plane;
  // The middle vertex slides inside the surface, which stays the same set of points.
  Eigen::Matrix3Xf slid = plane.positions;
  slid.col(4).x() += 0.25F;
  const SurfaceError error =
      CompareSurfaces(slid, plane.positions, plane.triangles, Vector3d::Zero());
  EXPECT_NEAR(error.vertex_mm, 250.0 / 9, 1e-9);
  EXPECT_NEAR(error.surface_mm, 0, 1e-9);
}

TEST(SurfaceMetrics, KnownDistances) {
  const Plane plane;
  const Eigen::Matrix3Xf lifted = plane.positions.colwise() + Eigen::Vector3f(0, 0, 0.01F);
  const SurfaceError lift =
      CompareSurfaces(lifted, plane.positions, plane.triangles, Vector3d::Zero());
  EXPECT_NEAR(lift.vertex_mm, 10, 1e-6);
  EXPECT_NEAR(lift.surface_mm, 10, 1e-6);
  // By half its width: a third of the vertices leave the surface, by a half, on either side.
  const Eigen::Matrix3Xf shifted = plane.positions.colwise() + Eigen::Vector3f(0.5F, 0, 0);
  const SurfaceError shift =
      CompareSurfaces(shifted, plane.positions, plane.triangles, Vector3d::Zero());
  EXPECT_NEAR(shift.vertex_mm, 500, 1e-9);
  EXPECT_NEAR(shift.surface_mm, 500.0 / 3, 1e-9);
}

TEST(SurfaceMetrics, BothDirectionsCount) {
  // The estimate has a spike; from the truth's side nothing is far away but the spike's own foot.
  const Plane plane;
  Eigen::Matrix3Xf spike = plane.positions;
  spike.col(4).z() = 1;
  const double a =
      CompareSurfaces(spike, plane.positions, plane.triangles, Vector3d::Zero()).surface_mm;
  const double b =
      CompareSurfaces(plane.positions, spike, plane.triangles, Vector3d::Zero()).surface_mm;
  EXPECT_DOUBLE_EQ(a, b);
  EXPECT_GT(a, 0.5 * 1000.0 / 9);  // the spike's tip is 1 m away, seen from one side alone
}

TEST(SurfaceMetrics, RefusesDifferentMeshes) {
  const Plane plane;
  const Eigen::Matrix3Xf fewer = plane.positions.leftCols(8);
  EXPECT_MPC_ERROR(MeanOffset(plane.positions, fewer), kMismatch, "9 and 8 vertices");
  EXPECT_MPC_ERROR(CompareSurfaces(fewer, plane.positions, plane.triangles, Vector3d::Zero()),
                   kMismatch, "8 and 9 vertices");
  const Eigen::Matrix3Xf none(3, 0);
  EXPECT_MPC_ERROR(MeanOffset(none, none), kMismatch, "0 and 0 vertices");
}

}  // namespace
}  // namespace mpc
