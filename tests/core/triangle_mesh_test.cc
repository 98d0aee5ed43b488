#include "mpc/core/triangle_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "support/expect_error.h"

namespace mpc {
namespace {

// A sphere of radius 2 around the origin as an octahedron split `levels` times. Every new vertex is
// made per triangle, so that vertices on shared edges repeat bit by bit.
TriangleMesh SplitSphere(int levels) {
  std::vector<Eigen::Vector3f> corners;
  for (const float x : {-1.f, 1.f}) {
    for (const float y : {-1.f, 1.f}) {
      for (const float z : {-1.f, 1.f}) {
        const Eigen::Vector3f a(x, 0, 0), b(0, y, 0), c(0, 0, z);
        const bool outward = x * y * z > 0;
        for (const auto& corner : {a, outward ? b : c, outward ? c : b}) corners.push_back(corner);
      }
    }
  }
  for (int level = 0; level < levels; ++level) {
    std::vector<Eigen::Vector3f> split;
    for (size_t i = 0; i < corners.size(); i += 3) {
      const Eigen::Vector3f a = corners[i], b = corners[i + 1], c = corners[i + 2];
      const Eigen::Vector3f ab = a + b, bc = b + c, ca = c + a;
      for (const auto& corner : {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca}) {
        split.push_back(corner);
      }
    }
    corners = split;
    for (auto& corner : corners) corner.normalize();
  }
  TriangleMesh mesh;
  const auto num_corners = static_cast<Eigen::Index>(corners.size());
  mesh.positions.resize(3, num_corners);
  mesh.triangles.resize(3, num_corners / 3);
  for (int i = 0; i < num_corners; ++i) {
    mesh.positions.col(i) = 2 * corners[static_cast<size_t>(i)];
    mesh.triangles(i % 3, i / 3) = i;
  }
  return mesh;
}

// The same with every position once.
TriangleMesh WeldedSphere(int levels) {
  TriangleMesh mesh = SplitSphere(levels);
  const std::vector<int> welded = WeldedVertices(mesh.positions);
  mesh.triangles = mesh.triangles.unaryExpr([&](int v) { return welded[static_cast<size_t>(v)]; });
  return mesh;
}

TEST(TriangleMeshTest, ClosedSurfaceSatisfiesEuler) {
  const TriangleMesh mesh = WeldedSphere(3);
  const std::vector<MeshEdge> edges = MeshEdges(mesh.triangles);
  const std::set<int> vertices(mesh.triangles.data(),
                               mesh.triangles.data() + mesh.triangles.size());
  const auto num_vertices = static_cast<int>(vertices.size());
  const auto num_edges = static_cast<int>(edges.size());
  EXPECT_EQ(num_vertices - num_edges + static_cast<int>(mesh.triangles.cols()), 2);
  for (size_t e = 0; e < edges.size(); ++e) {
    const MeshEdge& edge = edges[e];
    EXPECT_LT(edge.v0, edge.v1);
    if (e > 0) {
      EXPECT_LT(std::pair(edges[e - 1].v0, edges[e - 1].v1), std::pair(edge.v0, edge.v1));
    }
    EXPECT_NE(edge.faces[0], edge.faces[1]);
    for (const int face : edge.faces) {
      ASSERT_GE(face, 0);
      const auto corners = mesh.triangles.col(face).array();
      EXPECT_TRUE((corners == edge.v0).any() && (corners == edge.v1).any());
    }
  }
}

TEST(TriangleMeshTest, BorderAndNonManifoldEdges) {
  Triangles triangles(3, 4);
  triangles << 0, 1, 0, 5,  //
      1, 0, 1, 5,           //
      2, 3, 4, 6;           // 0-1 has three faces, the last triangle is degenerate
  const std::vector<MeshEdge> edges = MeshEdges(triangles);
  ASSERT_EQ(edges.size(), 8u);
  EXPECT_EQ(edges[0].faces, (std::array<int, 2>{0, 1}));
  EXPECT_EQ(edges[1].v1, 2);
  EXPECT_EQ(edges[1].faces, (std::array<int, 2>{0, -1}));
  EXPECT_EQ(edges[7].v0, 5);
  EXPECT_EQ(edges[7].v1, 6);
}

TEST(TriangleMeshTest, WeldingFindsTheLowestTwin) {
  const TriangleMesh mesh = SplitSphere(2);
  const std::vector<int> welded = WeldedVertices(mesh.positions);
  ASSERT_EQ(welded.size(), static_cast<size_t>(mesh.positions.cols()));
  for (int v = 0; v < mesh.positions.cols(); ++v) {
    int lowest = 0;
    while (mesh.positions.col(lowest) != mesh.positions.col(v)) ++lowest;
    EXPECT_EQ(welded[static_cast<size_t>(v)], lowest);
  }
  const std::set<int> distinct(welded.begin(), welded.end());
  EXPECT_EQ(distinct.size(), 66u);  // 6, 18, 66 vertices of the octahedron split 0, 1, 2 times
}

TEST(TriangleMeshTest, NormalsOfASpherePointAlongTheRadius) {
  const TriangleMesh mesh = WeldedSphere(3);
  Eigen::Matrix3Xf normals;
  VertexNormals(mesh.positions, mesh.triangles, &normals);
  ASSERT_EQ(normals.cols(), mesh.positions.cols());
  const std::set<int> used(mesh.triangles.data(), mesh.triangles.data() + mesh.triangles.size());
  for (int v = 0; v < normals.cols(); ++v) {
    if (used.contains(v)) {
      EXPECT_NEAR(normals.col(v).norm(), 1, 1e-6);
      EXPECT_GT(normals.col(v).dot(mesh.positions.col(v)) / 2, 0.995);
    } else {
      EXPECT_EQ(normals.col(v), Eigen::Vector3f::Zero());
    }
  }
}

TEST(TriangleMeshTest, NormalsWeighByArea) {
  // Two triangles at a right angle share vertex 0; one has three times the area of the other.
  Eigen::Matrix3Xf positions(3, 4);
  positions << 0, 3, 0, 0,  //
      0, 0, 1, 0,           //
      0, 0, 0, 1;
  Triangles triangles(3, 2);
  triangles << 0, 0,  //
      1, 2,           //
      2, 3;
  Eigen::Matrix3Xf normals;
  VertexNormals(positions, triangles, &normals);
  EXPECT_LT((normals.col(0) - Eigen::Vector3f(1, 0, 3).normalized()).norm(), 1e-6f);
}

TEST(TriangleMeshTest, ValidateRefusesBadMeshes) {
  SplitSphere(1).Validate();
  TriangleMesh mesh = SplitSphere(0);
  mesh.triangles(1, 2) = 24;
  EXPECT_MPC_ERROR(mesh.Validate(), kInvalidArgument, "triangle 2 uses vertex 24 of 24");
  mesh.triangles(1, 2) = -1;
  EXPECT_MPC_ERROR(mesh.Validate(), kInvalidArgument, "vertex -1");
  mesh = SplitSphere(0);
  mesh.positions(0, 5) = std::numeric_limits<float>::infinity();
  EXPECT_MPC_ERROR(mesh.Validate(), kInvalidArgument, "vertex 5 is not finite");
}

}  // namespace
}  // namespace mpc
