// Purpose: where the nodes of a deformation graph sit and which are neighbours.
// Source: paper, Section 5.3, "uniform mesh decimation"; OpenMesh's decimater.
// Symbols: V vertices, M nodes.
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

struct GraphNodes {
  std::vector<int> vertices;               // M
  std::vector<std::pair<int, int>> edges;  // of nodes, along the surface
};

// Component of every vertex, as its lowest vertex.
std::vector<int> Components(int num_vertices, const Triangles& triangles);

// About num_nodes vertices, evenly spread over the surface. `triangles`: of a mesh whose seams are
// closed, three different corners each, at least one.
GraphNodes ChooseNodes(const Eigen::Matrix3Xf& positions, const Triangles& triangles,
                       int num_nodes);

// Edges that tie together nodes that `edges` leaves apart, as short as possible in total. O(M^2).
std::vector<std::pair<int, int>> Ties(const Eigen::Matrix3Xf& nodes,
                                      const std::vector<std::pair<int, int>>& edges);

}  // namespace mpc
