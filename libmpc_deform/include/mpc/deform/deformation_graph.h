// Purpose: the embedded deformation graph of an actor, and the warp field it carries.
// Source: paper, Section 5.3, Eq. 13 to 15; Sumner et al. 2007; what the paper leaves open:
// docs/deform.md, "Deformation graph".
// Frames: any; the graph is built at bind and used at any pose of the same mesh. Units: metres.
// Symbols: V vertices, M nodes, K influences per vertex; g^_i position of node i before the warp.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

struct DeformationGraphOptions {
  int num_nodes = 1000;    // M, about; a mesh with fewer vertices has a node at each; paper
  int max_influences = 6;  // K, at most; ours

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

// Nodes sit on vertices of the mesh, so they follow it through every pose.
struct DeformationGraph {
  std::vector<int> node_vertices;  // M, different vertices
  Eigen::VectorXf radii;           // M, radius of influence along the surface at bind, m
  // The 1-ring N_i of node i, ascending: neighbors[neighbor_begin[i]] to [neighbor_begin[i + 1]].
  // j in N_i if and only if i in N_j. All nodes hang together.
  std::vector<int> neighbor_begin;  // M+1
  std::vector<int> neighbors;
  // Nodes F_v of vertex v and their weights b, heaviest first, summing to one; places that are not
  // needed hold weight 0 and node 0. Vertices at one position have the same.
  Eigen::MatrixXi influences;  // KxV
  Eigen::MatrixXf weights;     // KxV

  int num_nodes() const { return static_cast<int>(node_vertices.size()); }
  int num_vertices() const { return static_cast<int>(influences.cols()); }
  Eigen::Matrix3Xd NodePositions(const Eigen::Matrix3Xf& posed) const;  // g^, 3xM
};

// Nodes: what remains when the shortest edge of the mesh, seams closed, is collapsed again and
// again. Radius: the largest distance along edges to a neighbour. Weights: exp(-2 d^2 / radius^2)
// of the distance d along edges, over the K heaviest nodes within their radius. Parts of a mesh
// that hang on nothing are tied by an edge between their closest nodes; parts too small for nodes,
// and vertices without a triangle, follow the closest nodes in space. Any triangles will do.
//
// Some tenths of a second for 10,000 vertices, seconds for 100,000. Throws Error (kInvalidArgument) for
// a mesh that does not validate or has no triangle of three different positions.
DeformationGraph BuildDeformationGraph(const TriangleMesh& mesh,
                                       const DeformationGraphOptions& options = {});

// D = {(R_i, t_i)}: W_i(x) = R_i (x - g^_i) + g^_i + t_i.
struct WarpField {
  std::vector<Eigen::Matrix3d> rotations;  // M
  Eigen::Matrix3Xd translations;           // 3xM, m

  static WarpField Identity(int num_nodes);
};

// v_i = sum over k of b_ik W_k(v^_i) for all vertices: 3xV, sized by the function; must not alias
// `posed`. The identity leaves every bit as it is. Throws Error (kInvalidArgument) for sizes that do
// not fit.
void WarpVertices(const DeformationGraph& graph, const WarpField& field,
                  const Eigen::Matrix3Xf& posed, Eigen::Matrix3Xf* warped);

}  // namespace mpc
