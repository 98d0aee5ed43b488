#include "mpc/deform/deformation_graph.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <queue>
#include <random>
#include <set>

#include "deform/surface_meshes.h"
#include "mpc/core/rigid.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using testing::Ball;
using testing::Dressed;
using testing::Joined;
using testing::Tube;

// Everything that holds for the graph of any mesh.
void CheckGraph(const DeformationGraph& graph, const TriangleMesh& mesh) {
  const int num_nodes = graph.num_nodes();
  ASSERT_GT(num_nodes, 0);
  ASSERT_EQ(graph.num_vertices(), mesh.positions.cols());
  EXPECT_EQ(std::set<int>(graph.node_vertices.begin(), graph.node_vertices.end()).size(),
            graph.node_vertices.size());
  for (const int v : graph.node_vertices) EXPECT_TRUE(v >= 0 && v < mesh.positions.cols());
  // Weights: a partition of unity, heaviest first, then zeros.
  EXPECT_LT((graph.weights.colwise().sum().array() - 1).abs().maxCoeff(), 1e-6f);
  EXPECT_GE(graph.weights.minCoeff(), 0);
  EXPECT_TRUE(graph.influences.minCoeff() >= 0 && graph.influences.maxCoeff() < num_nodes);
  for (Eigen::Index k = 1; k < graph.weights.rows(); ++k) {
    EXPECT_TRUE((graph.weights.row(k).array() <= graph.weights.row(k - 1).array()).all());
  }
  // Neighbours: ascending, mutual, nobody their own; one whole.
  std::set<std::pair<int, int>> edges;
  for (int i = 0; i < num_nodes; ++i) {
    for (int e = graph.neighbor_begin[i]; e < graph.neighbor_begin[i + 1]; ++e) {
      EXPECT_NE(graph.neighbors[e], i);
      EXPECT_TRUE(edges.emplace(i, graph.neighbors[e]).second);
      EXPECT_TRUE(e == graph.neighbor_begin[i] || graph.neighbors[e - 1] < graph.neighbors[e]);
    }
  }
  std::vector<char> seen(num_nodes, 0);
  std::queue<int> queue({0});
  seen[0] = 1;
  int count = 0;
  for (; !queue.empty(); queue.pop(), ++count) {
    const int i = queue.front();
    for (int e = graph.neighbor_begin[i]; e < graph.neighbor_begin[i + 1]; ++e) {
      const int j = graph.neighbors[e];
      EXPECT_EQ(edges.count({j, i}), 1u);
      if (!seen[j]) queue.push(j);
      seen[j] = 1;
    }
  }
  EXPECT_EQ(count, num_nodes);
  EXPECT_TRUE(graph.radii.allFinite());

  // The identity leaves the mesh alone, bit for bit; a rigid motion of all nodes moves it rigidly.
  Eigen::Matrix3Xf warped;
  WarpVertices(graph, WarpField::Identity(num_nodes), mesh.positions, &warped);
  EXPECT_EQ(warped, mesh.positions);
  const Eigen::Matrix3d rotation = ExpSO3({0.3, -0.8, 0.4});
  const Eigen::Vector3d translation(0.2, -0.1, 0.5);
  WarpField field = WarpField::Identity(num_nodes);
  const Eigen::Matrix3Xd nodes = graph.NodePositions(mesh.positions);
  for (int i = 0; i < num_nodes; ++i) {
    field.rotations[i] = rotation;
    field.translations.col(i) = rotation * nodes.col(i) + translation - nodes.col(i);
  }
  WarpVertices(graph, field, mesh.positions, &warped);
  const Eigen::Matrix3Xd expected =
      (rotation * mesh.positions.cast<double>()).colwise() + translation;
  EXPECT_LT((warped.cast<double>() - expected).colwise().norm().maxCoeff(), 1e-5);
}

TEST(DeformationGraphTest, EvenlySpreadNodes) {
  const TriangleMesh mesh = Ball({0, 0, 0}, 1, 80, 120);
  const DeformationGraph graph = BuildDeformationGraph(mesh, {.num_nodes = 500});
  CheckGraph(graph, mesh);
  EXPECT_EQ(graph.num_nodes(), 500);
  // Each node would own a disk of radius 0.09 of the unit sphere. The poles of the mesh have many
  // times the vertices; they must not have the nodes.
  const Eigen::Matrix3Xd nodes = graph.NodePositions(mesh.positions);
  int close = 0;
  double farthest = 0;
  for (int i = 0; i < 500; ++i) {
    double nearest = 10;
    for (int j = 0; j < 500; ++j) {
      if (j != i) nearest = std::min(nearest, (nodes.col(i) - nodes.col(j)).norm());
    }
    close += nearest < 0.08;
    farthest = std::max(farthest, nearest);
  }
  EXPECT_LT(close, 25);
  EXPECT_LT(farthest, 0.25);
  EXPECT_NEAR(static_cast<double>(graph.neighbors.size()) / 500, 6, 0.1);  // a triangulation
}

TEST(DeformationGraphTest, InfluencesLieWithinTheRadius) {
  // On a tube of edges along and across, distances along edges are those of the unrolled grid.
  const TriangleMesh mesh = Tube({0, 0, 0}, 2, 0.3, 0.3, 60, 60);
  const DeformationGraph graph = BuildDeformationGraph(mesh, {.num_nodes = 200});
  CheckGraph(graph, mesh);
  const Eigen::Matrix3Xd nodes = graph.NodePositions(mesh.positions);
  for (int v = 0; v < graph.num_vertices(); ++v) {
    for (Eigen::Index k = 0; k < graph.weights.rows() && graph.weights(k, v) > 0; ++k) {
      const int i = graph.influences(k, v);
      const double straight = (nodes.col(i) - mesh.positions.col(v).cast<double>()).norm();
      EXPECT_LE(straight, graph.radii[i] + 1e-6);
    }
  }
  for (int i = 0; i < graph.num_nodes(); ++i) {
    double straight = 0;
    for (int e = graph.neighbor_begin[i]; e < graph.neighbor_begin[i + 1]; ++e) {
      straight = std::max(straight, (nodes.col(i) - nodes.col(graph.neighbors[e])).norm());
    }
    EXPECT_GE(graph.radii[i], straight - 1e-6);
    EXPECT_LE(graph.radii[i], 1.7 * straight);
  }
  // A node weighs most where it sits.
  for (int i = 0; i < graph.num_nodes(); ++i) {
    EXPECT_EQ(graph.influences(0, graph.node_vertices[i]), i);
  }
}

TEST(DeformationGraphTest, DistanceIsAlongTheSurface) {
  // Two sheets 1 cm apart, joined at one end only: no node of one moves the other at the far end.
  TriangleMesh mesh = Tube({0, 0, 0}, 1, 0.2, 0.2, 80, 80);
  mesh.positions.row(2) *= 0.025f;  // pressed flat
  const DeformationGraph graph = BuildDeformationGraph(mesh, {.num_nodes = 300});
  CheckGraph(graph, mesh);
  for (int v = 0; v < graph.num_vertices(); ++v) {
    if (std::abs(mesh.positions(0, v)) > 0.04f) continue;
    for (Eigen::Index k = 0; k < graph.weights.rows() && graph.weights(k, v) > 0; ++k) {
      const int node = graph.node_vertices[graph.influences(k, v)];
      EXPECT_GT(mesh.positions(2, node) * mesh.positions(2, v), 0) << v;
    }
  }
}

TEST(DeformationGraphTest, SmallMeshesHaveANodePerVertex) {
  const TriangleMesh mesh = Ball({0, 0, 0}, 1, 6, 8);
  const DeformationGraph graph = BuildDeformationGraph(mesh);
  CheckGraph(graph, mesh);
  EXPECT_EQ(graph.num_nodes(), mesh.positions.cols());
  TriangleMesh triangle;
  triangle.positions = Eigen::Matrix3f::Identity();
  triangle.triangles.resize(3, 1);
  triangle.triangles << 0, 1, 2;
  CheckGraph(BuildDeformationGraph(triangle), triangle);
  CheckGraph(BuildDeformationGraph(triangle, {.num_nodes = 1}), triangle);
  CheckGraph(BuildDeformationGraph(mesh, {.num_nodes = 1, .max_influences = 1}), mesh);
}

TEST(DeformationGraphTest, ComponentsHangTogether) {
  const TriangleMesh mesh = Dressed();
  const DeformationGraph graph = BuildDeformationGraph(mesh, {.num_nodes = 400});
  CheckGraph(graph, mesh);
  // Weights do not cross from one component to the other, edges do so once.
  const int trunk = 40 * 40 + 2;
  int crossing = 0;
  for (int i = 0; i < graph.num_nodes(); ++i) {
    for (int e = graph.neighbor_begin[i]; e < graph.neighbor_begin[i + 1]; ++e) {
      crossing +=
          (graph.node_vertices[i] < trunk) != (graph.node_vertices[graph.neighbors[e]] < trunk);
    }
  }
  EXPECT_EQ(crossing, 2);
  for (int v = 0; v < graph.num_vertices(); ++v) {
    for (Eigen::Index k = 0; k < graph.weights.rows() && graph.weights(k, v) > 0; ++k) {
      EXPECT_EQ(graph.node_vertices[graph.influences(k, v)] < trunk, v < trunk);
    }
  }
}

TEST(DeformationGraphTest, SeamsAreClosed) {
  // The two halves of a ball, each with its own copies of the vertices along the cut.
  const TriangleMesh ball = Ball({0, 0, 0}, 1, 60, 80);
  TriangleMesh seamed;
  const Eigen::Index num_vertices = ball.positions.cols(), half = ball.triangles.cols() / 2;
  seamed.positions.resize(3, 2 * num_vertices);
  seamed.positions << ball.positions, ball.positions;
  seamed.triangles = ball.triangles;
  seamed.triangles.rightCols(half).array() += static_cast<int>(num_vertices);
  const DeformationGraph one = BuildDeformationGraph(ball), two = BuildDeformationGraph(seamed);
  CheckGraph(two, seamed);
  EXPECT_EQ(one.node_vertices, two.node_vertices);
  EXPECT_EQ(one.neighbors, two.neighbors);
  EXPECT_EQ(one.weights, two.weights.leftCols(num_vertices));
  EXPECT_EQ(one.weights, two.weights.rightCols(num_vertices));
  EXPECT_EQ(one.influences, two.influences.rightCols(num_vertices));
}

TEST(DeformationGraphTest, SmallPartsFollowTheClosestNodes) {
  // A button of two triangles before the trunk, and vertices that no triangle uses.
  TriangleMesh button = Tube({0, 0, -0.22}, 0.01, 0.005, 0.005, 2, 4);
  TriangleMesh trunk = Ball({0, 0, 0}, 0.2, 60, 80);
  TriangleMesh mesh = Joined(trunk, button);
  mesh.positions.conservativeResize(3, mesh.positions.cols() + 2);
  mesh.positions.rightCols(2) << 0, 5, 0.21f, 5, 0, 5;
  const DeformationGraph graph = BuildDeformationGraph(mesh, {.num_nodes = 300});
  CheckGraph(graph, mesh);
  for (Eigen::Index v = trunk.positions.cols(); v < mesh.positions.cols() - 1; ++v) {
    const int node = graph.node_vertices[graph.influences(0, v)];
    EXPECT_LT(node, trunk.positions.cols());
    EXPECT_LT((mesh.positions.col(node) - mesh.positions.col(v)).norm(), 0.06f);
  }
}

TEST(DeformationGraphTest, AnyTrianglesWillDo) {
  std::mt19937_64 random(3);
  for (int round = 0; round < 20; ++round) {
    // Open, non-manifold, both orientations, degenerate, repeated, with holes and lonely vertices.
    TriangleMesh mesh = testing::Tangle(60, 20 + 20 * round, 0.3, {0, 0, 0}, &random);
    if (round % 2 == 1) mesh = Joined(mesh, Ball({0.5, 0, 0}, 0.3, 20, 20));
    mesh.triangles.col(0).setConstant(1);
    mesh.triangles.col(1) = mesh.triangles.col(2);
    for (const int num_nodes : {1, 30, 1000}) {
      CheckGraph(BuildDeformationGraph(mesh, {.num_nodes = num_nodes}), mesh);
    }
  }
}

TEST(DeformationGraphTest, TriangleSoup) {
  // No two triangles share a vertex.
  const TriangleMesh ball = Ball({0, 0, 0}, 1, 20, 30);
  TriangleMesh soup;
  soup.positions.resize(3, 3 * ball.triangles.cols());
  soup.triangles.resize(3, ball.triangles.cols());
  for (int t = 0; t < ball.triangles.cols(); ++t) {
    for (int c = 0; c < 3; ++c) {
      soup.triangles(c, t) = 3 * t + c;
      // Apart by more than rounding, so that welding does not close it.
      soup.positions.col(3 * t + c) =
          ball.positions.col(ball.triangles(c, t)) * (1 + 1e-4f * static_cast<float>(t % 17));
    }
  }
  const DeformationGraph graph = BuildDeformationGraph(soup, {.num_nodes = 100});
  CheckGraph(graph, soup);
  EXPECT_GT(graph.num_nodes(), 30);
  EXPECT_LT(graph.num_nodes(), 400);
}

TEST(DeformationGraphTest, TheSameTwice) {
  const TriangleMesh mesh = Dressed();
  const DeformationGraph one = BuildDeformationGraph(mesh), two = BuildDeformationGraph(mesh);
  EXPECT_EQ(one.node_vertices, two.node_vertices);
  EXPECT_EQ(one.neighbors, two.neighbors);
  EXPECT_EQ(one.weights, two.weights);
}

TEST(DeformationGraphTest, MisuseIsRefused) {
  TriangleMesh mesh = Ball({0, 0, 0}, 1, 6, 8);
  EXPECT_MPC_ERROR(BuildDeformationGraph(mesh, {.num_nodes = 0, .max_influences = 99}),
                   kInvalidArgument, "num_nodes is 0, expected 1 to 20000; max_influences is 99");
  const DeformationGraph graph = BuildDeformationGraph(mesh);
  Eigen::Matrix3Xf warped;
  EXPECT_MPC_ERROR(WarpVertices(graph, WarpField::Identity(3), mesh.positions, &warped),
                   kInvalidArgument, "3 rotations");
  EXPECT_MPC_ERROR(WarpVertices(graph, WarpField::Identity(graph.num_nodes()),
                                mesh.positions.leftCols(7), &warped),
                   kInvalidArgument, "7 vertices");
  mesh.positions(1, 3) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_MPC_ERROR(BuildDeformationGraph(mesh), kInvalidArgument, "vertex 3");
  EXPECT_MPC_ERROR(BuildDeformationGraph(TriangleMesh{}), kInvalidArgument, "no triangle");
  mesh = Ball({0, 0, 0}, 1, 6, 8);
  mesh.triangles.setConstant(2);
  EXPECT_MPC_ERROR(BuildDeformationGraph(mesh), kInvalidArgument, "no triangle");
}

}  // namespace
}  // namespace mpc
