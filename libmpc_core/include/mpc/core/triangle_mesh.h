// Purpose: an indexed triangle mesh and its edges.
// Units: metres. Symbols: V vertices, T triangles, E edges.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace mpc {

using Triangles = Eigen::Matrix<int, 3, Eigen::Dynamic>;

struct TriangleMesh {
  Eigen::Matrix3Xf positions;  // 3xV
  Triangles triangles;         // 3xT, counter-clockwise seen from outside

  // Throws Error (kInvalidArgument) for an index out of range or a non-finite position.
  void Validate() const;
};

struct MeshEdge {
  int v0 = 0;  // v0 < v1
  int v1 = 0;
  std::array<int, 2> faces = {-1, -1};  // triangles on both sides; -1 at a border
};

// Every edge once, ordered by (v0, v1). An edge with more than two faces keeps the first two.
// O(T log T).
std::vector<MeshEdge> MeshEdges(const Triangles& triangles);

// Welds vertices with bit-identical positions (UV seams split them): for each vertex the lowest
// index with the same position, V entries. O(V log V).
std::vector<int> WeldedVertices(const Eigen::Matrix3Xf& positions);

// Area-weighted unit vertex normals, 3xV; zero for a vertex without a triangle of positive area.
void VertexNormals(const Eigen::Matrix3Xf& positions, const Triangles& triangles,
                   Eigen::Matrix3Xf* normals);

}  // namespace mpc
