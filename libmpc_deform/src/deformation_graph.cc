#include "mpc/deform/deformation_graph.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "geodesics.h"
#include "graph_nodes.h"
#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr int kMaxNodes = 20000;
constexpr int kMaxInfluences = 16;

// A node that influences a vertex. Weights are exp(-penalty), up to a factor common to the vertex.
struct Influence {
  float penalty;
  int node;
  auto operator<=>(const Influence&) const = default;
};

float Penalty(float distance, float radius) {
  const float relative = distance / radius;
  return 2 * relative * relative;
}

// Triangles between the first vertices at their corners' positions, degenerate ones left out.
Triangles ClosedSeams(const Triangles& triangles, const std::vector<int>& welded) {
  Triangles closed(3, triangles.cols());
  int count = 0;
  for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
    const Eigen::Vector3i v(welded[triangles(0, t)], welded[triangles(1, t)],
                            welded[triangles(2, t)]);
    if (v[0] != v[1] && v[1] != v[2] && v[2] != v[0]) closed.col(count++) = v;
  }
  closed.conservativeResize(3, count);
  return closed;
}

void SetNeighbors(int num_nodes, const std::vector<std::pair<int, int>>& edges,
                  DeformationGraph* graph) {
  graph->neighbor_begin.assign(num_nodes + 1, 0);
  for (const auto& [i, j] : edges) {
    ++graph->neighbor_begin[i + 1];
    ++graph->neighbor_begin[j + 1];
  }
  for (int i = 0; i < num_nodes; ++i) graph->neighbor_begin[i + 1] += graph->neighbor_begin[i];
  graph->neighbors.resize(2 * edges.size());
  std::vector<int> end = graph->neighbor_begin;
  for (const auto& [i, j] : edges) {
    graph->neighbors[end[i]++] = j;
    graph->neighbors[end[j]++] = i;
  }
  for (int i = 0; i < num_nodes; ++i) {
    std::sort(graph->neighbors.begin() + graph->neighbor_begin[i],
              graph->neighbors.begin() + graph->neighbor_begin[i + 1]);
  }
}

// The radius of every node, and the nodes within whose radius each vertex lies.
std::vector<std::vector<Influence>> SpreadNodes(const GraphNodes& nodes, int num_vertices,
                                                EdgeDistances* distances, Eigen::VectorXf* radii) {
  const int num_nodes = static_cast<int>(nodes.vertices.size());
  std::vector<std::vector<int>> neighbors(num_nodes);
  for (const auto& [i, j] : nodes.edges) {
    neighbors[i].push_back(nodes.vertices[j]);
    neighbors[j].push_back(nodes.vertices[i]);
  }
  std::vector<std::vector<Influence>> influences(num_vertices);
  std::vector<char> awaited(num_vertices, 0);
  std::vector<std::pair<int, float>> visited;
  radii->resize(num_nodes);
  for (int i = 0; i < num_nodes; ++i) {
    size_t missing = neighbors[i].size();
    for (const int v : neighbors[i]) awaited[v] = 1;
    visited.clear();
    (*radii)[i] = 0;
    distances->Walk({nodes.vertices[i]}, [&](int v, int, float distance) {
      visited.emplace_back(v, distance);
      if (awaited[v]) --missing;
      if (awaited[v] || neighbors[i].empty()) (*radii)[i] = distance;
      return missing > 0 || neighbors[i].empty();  // a node on its own takes all it reaches
    });
    for (const int v : neighbors[i]) awaited[v] = 0;
    for (const auto& [v, distance] : visited) {
      influences[v].push_back({distance > 0 ? Penalty(distance, (*radii)[i]) : 0, i});
    }
  }
  return influences;
}

// What no radius covers follows the node it reaches first.
void FillGaps(const GraphNodes& nodes, EdgeDistances* distances,
              std::vector<std::vector<Influence>>* influences) {
  if (std::none_of(influences->begin(), influences->end(),
                   [](const std::vector<Influence>& list) { return list.empty(); })) {
    return;
  }
  distances->Walk(nodes.vertices, [&](int v, int node, float) {
    if ((*influences)[v].empty()) (*influences)[v].push_back({0, node});
    return true;
  });
}

// For a vertex that reaches no node: the closest ones in space.
std::vector<Influence> ClosestInSpace(const Eigen::Vector3f& position,
                                      const Eigen::Matrix3Xf& nodes, const Eigen::VectorXf& radii,
                                      int count) {
  const float spacing = std::max(radii.mean(), std::numeric_limits<float>::min());
  std::vector<Influence> influences;
  influences.reserve(static_cast<size_t>(nodes.cols()));
  for (int i = 0; i < nodes.cols(); ++i) {
    influences.push_back({Penalty((nodes.col(i) - position).norm(), spacing), i});
  }
  const auto end = influences.begin() + std::min<std::ptrdiff_t>(count, nodes.cols());
  std::partial_sort(influences.begin(), end, influences.end());
  influences.erase(end, influences.end());
  return influences;
}

void SetWeights(int v, std::vector<Influence> influences, DeformationGraph* graph) {
  std::sort(influences.begin(), influences.end());
  const int count =
      static_cast<int>(std::min<Eigen::Index>(influences.size(), graph->weights.rows()));
  Eigen::VectorXf weights(count);
  for (int k = 0; k < count; ++k) {
    weights[k] = std::exp(influences[0].penalty - influences[k].penalty);
    graph->influences(k, v) = influences[k].node;
  }
  graph->weights.col(v).head(count) = weights / weights.sum();
}

}  // namespace

void DeformationGraphOptions::Validate() const {
  std::string faults;
  if (num_nodes < 1 || num_nodes > kMaxNodes) {
    faults += fmt::format("; num_nodes is {}, expected 1 to {}", num_nodes, kMaxNodes);
  }
  if (max_influences < 1 || max_influences > kMaxInfluences) {
    faults +=
        fmt::format("; max_influences is {}, expected 1 to {}", max_influences, kMaxInfluences);
  }
  if (!faults.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "deformation graph options: " + faults.substr(2));
  }
}

DeformationGraph BuildDeformationGraph(const TriangleMesh& mesh,
                                       const DeformationGraphOptions& options) {
  options.Validate();
  mesh.Validate();
  const int num_vertices = static_cast<int>(mesh.positions.cols());
  const std::vector<int> welded = WeldedVertices(mesh.positions);
  const Triangles triangles = ClosedSeams(mesh.triangles, welded);
  if (triangles.cols() == 0) {
    throw Error(ErrorCode::kInvalidArgument,
                "deformation graph: no triangle has three different corners");
  }
  const GraphNodes nodes = ChooseNodes(mesh.positions, triangles, options.num_nodes);
  Eigen::Matrix3Xf node_positions(3, nodes.vertices.size());
  for (size_t i = 0; i < nodes.vertices.size(); ++i) {
    node_positions.col(i) = mesh.positions.col(nodes.vertices[i]);
  }

  DeformationGraph graph;
  graph.node_vertices = nodes.vertices;
  std::vector<std::pair<int, int>> edges = nodes.edges;
  const std::vector<std::pair<int, int>> ties = Ties(node_positions, nodes.edges);
  edges.insert(edges.end(), ties.begin(), ties.end());
  SetNeighbors(graph.num_nodes(), edges, &graph);

  EdgeDistances distances(mesh.positions, triangles);
  std::vector<std::vector<Influence>> influences =
      SpreadNodes(nodes, num_vertices, &distances, &graph.radii);
  FillGaps(nodes, &distances, &influences);
  const int max_influences = std::min(options.max_influences, graph.num_nodes());
  graph.influences.setZero(max_influences, num_vertices);
  graph.weights.setZero(max_influences, num_vertices);
  for (int v = 0; v < num_vertices; ++v) {
    std::vector<Influence> list = influences[welded[v]];
    if (list.empty()) {
      list = ClosestInSpace(mesh.positions.col(v), node_positions, graph.radii, max_influences);
    }
    SetWeights(v, std::move(list), &graph);
  }
  return graph;
}

Eigen::Matrix3Xd DeformationGraph::NodePositions(const Eigen::Matrix3Xf& posed) const {
  Eigen::Matrix3Xd nodes(3, num_nodes());
  for (int i = 0; i < num_nodes(); ++i) nodes.col(i) = posed.col(node_vertices[i]).cast<double>();
  return nodes;
}

}  // namespace mpc
