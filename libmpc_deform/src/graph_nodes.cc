#include "graph_nodes.h"

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <queue>

namespace mpc {
namespace {

using HalfedgeMesh = OpenMesh::TriMesh_ArrayKernelT<>;
using Corners = std::array<OpenMesh::VertexHandle, 3>;

// Whether a triangle keeps the mesh a manifold. OpenMesh refuses the others too, but complains on
// stderr.
bool Fits(const HalfedgeMesh& mesh, const Corners& corners) {
  std::array<OpenMesh::HalfedgeHandle, 3> sides;
  for (size_t c = 0; c < 3; ++c) {
    if (!mesh.is_boundary(corners[c])) return false;
    sides[c] = mesh.find_halfedge(corners[c], corners[(c + 1) % 3]);
    if (sides[c].is_valid() && !mesh.is_boundary(sides[c])) return false;
  }
  for (size_t c = 0; c < 3; ++c) {
    const OpenMesh::HalfedgeHandle in = sides[c], out = sides[(c + 1) % 3];
    if (!in.is_valid() || !out.is_valid() || mesh.next_halfedge_handle(in) == out) continue;
    // Both sides are there but not in a row: what lies between needs another gap to go to.
    OpenMesh::HalfedgeHandle gap = mesh.opposite_halfedge_handle(out);
    do {
      gap = mesh.opposite_halfedge_handle(mesh.next_halfedge_handle(gap));
    } while (!mesh.is_boundary(gap));
    if (gap == in) return false;
  }
  return true;
}

// Collapses the shortest edges first. Legality is asked for an edge whose turn it is, and again only
// after something close to it has changed: OpenMesh's own decimater asks for all edges around.
class EdgeCollapser {
 public:
  explicit EdgeCollapser(HalfedgeMesh* mesh) : mesh_(*mesh), refused_(mesh->n_edges(), 0) {
    for (const OpenMesh::EdgeHandle e : mesh_.edges()) Push(e);
  }

  // One edge less; false when none can go.
  bool Collapse() {
    while (!queue_.empty()) {
      const auto [length, edge] = queue_.top();
      queue_.pop();
      const OpenMesh::EdgeHandle e(edge);
      if (mesh_.status(e).deleted() || length != mesh_.calc_edge_sqr_length(e)) continue;
      for (const unsigned side : {0u, 1u}) {
        const OpenMesh::HalfedgeHandle h = mesh_.halfedge_handle(e, side);
        if (!IsLegal(h)) continue;
        const OpenMesh::VertexHandle kept = mesh_.to_vertex_handle(h);
        mesh_.collapse(h);
        Renew(kept);
        return true;
      }
      refused_[edge] = 1;
    }
    return false;
  }

 private:
  using Entry = std::pair<float, int>;  // squared length, edge

  void Push(OpenMesh::EdgeHandle e) {
    refused_[e.idx()] = 0;
    queue_.push({mesh_.calc_edge_sqr_length(e), e.idx()});
  }

  // Whether the start of h may go to its end. A boundary keeps to its course.
  bool IsLegal(OpenMesh::HalfedgeHandle h) {
    const OpenMesh::VertexHandle from = mesh_.from_vertex_handle(h);
    if (mesh_.is_boundary(from) && !mesh_.is_boundary(mesh_.edge_handle(h))) return false;
    int faces = 0;
    for (const OpenMesh::FaceHandle f : mesh_.vf_range(from)) faces += f.is_valid();
    return faces >= 2 && mesh_.is_collapse_ok(h);
  }

  // Edges that have another end now, and those that were refused with the old surroundings.
  void Renew(OpenMesh::VertexHandle kept) {
    for (const OpenMesh::EdgeHandle e : mesh_.ve_range(kept)) Push(e);
    for (const OpenMesh::VertexHandle near : mesh_.vv_range(kept)) {
      for (const OpenMesh::EdgeHandle e : mesh_.ve_range(near)) {
        if (refused_[e.idx()]) Push(e);
      }
    }
  }

  HalfedgeMesh& mesh_;
  std::vector<char> refused_;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

// What remains of the mesh when num_nodes vertices are left, or no edge can go.
GraphNodes Decimate(const Eigen::Matrix3Xf& positions, const Triangles& triangles,
                    const std::vector<char>& used, int num_nodes) {
  HalfedgeMesh mesh;
  mesh.request_vertex_status();
  mesh.request_edge_status();
  mesh.request_face_status();
  std::vector<OpenMesh::VertexHandle> handles(positions.cols());
  std::vector<int> vertex_of;
  for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
    if (!used[triangles(0, t)]) continue;
    Corners corners;
    for (int c = 0; c < 3; ++c) {
      const int v = triangles(c, t);
      OpenMesh::VertexHandle& handle = handles[v];
      if (!handle.is_valid()) {
        handle = mesh.add_vertex({positions(0, v), positions(1, v), positions(2, v)});
        vertex_of.push_back(v);
      }
      corners[c] = handle;
    }
    if (Fits(mesh, corners)) mesh.add_face(corners[0], corners[1], corners[2]);
  }

  EdgeCollapser collapser(&mesh);
  for (size_t left = mesh.n_vertices(); left > static_cast<size_t>(num_nodes); --left) {
    if (!collapser.Collapse()) break;
  }

  GraphNodes nodes;
  std::vector<int> node_of(mesh.n_vertices(), -1);
  for (const OpenMesh::VertexHandle v : mesh.vertices()) {
    // Without a face: all of its triangles were refused.
    if (mesh.is_isolated(v)) continue;
    node_of[v.idx()] = static_cast<int>(nodes.vertices.size());
    nodes.vertices.push_back(vertex_of[v.idx()]);
  }
  for (const OpenMesh::EdgeHandle e : mesh.edges()) {
    const OpenMesh::HalfedgeHandle h = mesh.halfedge_handle(e, 0);
    const int i = node_of[mesh.from_vertex_handle(h).idx()];
    const int j = node_of[mesh.to_vertex_handle(h).idx()];
    nodes.edges.emplace_back(std::min(i, j), std::max(i, j));
  }
  std::sort(nodes.edges.begin(), nodes.edges.end());
  nodes.edges.erase(std::unique(nodes.edges.begin(), nodes.edges.end()), nodes.edges.end());
  return nodes;
}

// Typical distance of neighbours.
float Spacing(const Eigen::Matrix3Xf& positions, const GraphNodes& nodes, int num_nodes) {
  if (nodes.edges.empty()) {
    const Eigen::Vector3f size = positions.rowwise().maxCoeff() - positions.rowwise().minCoeff();
    return size.norm() / std::sqrt(static_cast<float>(num_nodes));
  }
  std::vector<float> lengths;
  for (const auto& [i, j] : nodes.edges) {
    lengths.push_back((positions.col(nodes.vertices[i]) - positions.col(nodes.vertices[j])).norm());
  }
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

}  // namespace

std::vector<int> Components(int num_vertices, const Triangles& triangles) {
  std::vector<int> parent(num_vertices);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) {
      int& up = parent[v];
      v = up = parent[up];
    }
    return v;
  };
  for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
    for (int c = 1; c < 3; ++c) {
      const int a = root(triangles(0, t)), b = root(triangles(c, t));
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (int v = 0; v < num_vertices; ++v) parent[v] = root(v);
  return parent;
}

GraphNodes ChooseNodes(const Eigen::Matrix3Xf& positions, const Triangles& triangles,
                       int num_nodes) {
  const int num_vertices = static_cast<int>(positions.cols());
  const std::vector<int> component = Components(num_vertices, triangles);
  std::vector<char> in_triangle(num_vertices, 0);
  for (const int v : triangles.reshaped()) in_triangle[v] = 1;
  std::vector<int> size(num_vertices, 0);
  int total = 0;
  for (int v = 0; v < num_vertices; ++v) {
    if (!in_triangle[v]) continue;
    ++size[component[v]];
    ++total;
  }
  // A part takes part if its share of the nodes is one at least.
  std::vector<char> used(num_vertices, 0);
  for (int v = 0; v < num_vertices; ++v) {
    const int vertices = size[component[v]];
    used[v] = static_cast<double>(vertices) * num_nodes >= total;
  }
  GraphNodes nodes = Decimate(positions, triangles, used, num_nodes);

  // The rest gets a node where none is near.
  const float spacing = Spacing(positions, nodes, num_nodes);
  std::vector<char> reached(num_vertices, 0);
  for (const int v : nodes.vertices) reached[component[v]] = 1;
  for (int v = 0; v < num_vertices; ++v) {
    const size_t part = component[v];
    if (!in_triangle[v] || reached[part]) continue;
    const bool near = std::any_of(nodes.vertices.begin(), nodes.vertices.end(), [&](int node) {
      return (positions.col(node) - positions.col(v)).squaredNorm() < spacing * spacing;
    });
    if (!near) nodes.vertices.push_back(v);
  }
  return nodes;
}

std::vector<std::pair<int, int>> Ties(const Eigen::Matrix3Xf& nodes,
                                      const std::vector<std::pair<int, int>>& edges) {
  const int num_nodes = static_cast<int>(nodes.cols());
  std::vector<std::vector<int>> neighbors(num_nodes);
  for (const auto& [i, j] : edges) {
    neighbors[i].push_back(j);
    neighbors[j].push_back(i);
  }
  // Prim's tree, in which edges cost nothing.
  constexpr float kDone = -1;
  Eigen::VectorXf gap = Eigen::VectorXf::Constant(num_nodes, std::numeric_limits<float>::max());
  std::vector<int> from(num_nodes, -1);
  std::vector<std::pair<int, int>> ties;
  for (int count = 0; count < num_nodes; ++count) {
    int next = -1;
    for (int i = 0; i < num_nodes; ++i) {
      if (gap[i] != kDone && (next < 0 || gap[i] < gap[next])) next = i;
    }
    const int tied_to = from[next];
    if (tied_to >= 0) ties.emplace_back(std::min(next, tied_to), std::max(next, tied_to));
    gap[next] = kDone;
    for (int i = 0; i < num_nodes; ++i) {
      const float distance = (nodes.col(i) - nodes.col(next)).squaredNorm();
      if (distance >= gap[i]) continue;
      gap[i] = distance;
      from[i] = next;
    }
    for (const int i : neighbors[next]) {
      if (gap[i] == kDone) continue;
      gap[i] = 0;
      from[i] = -1;
    }
  }
  return ties;
}

}  // namespace mpc
