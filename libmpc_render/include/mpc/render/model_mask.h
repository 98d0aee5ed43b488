// Purpose: the masks of the trimap: M, the mesh as seen, and R, the skeleton as thin limbs.
// Source: paper, Section 5.1. M is found from the mesh's outline: edges between two triangles that
// face the same way cancel, so only the edges of outlines are drawn (docs/render.md).
// Frames: camera frame. Units: metres, pixels. Symbols: V vertices, T triangles.
// Masks are CV_8UC1 of the camera's size, 255 inside. To pay for a part of the picture only, pass
// the camera CroppedTo(camera, ProjectedBounds(...)).
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/capsule_set.h"
#include "mpc/core/triangle_mesh.h"

namespace mpc {

// How the triangles of a mesh hang together; the same for all its poses. Any triangles will do:
// open meshes, edges with three faces, neighbours of opposite orientation.
struct SurfaceTopology {
  // A side is 2 t for triangle t where it runs from v0 to v1, 2 t + 1 where it runs from v1 to v0.
  struct Edge {
    int v0 = 0;  // v0 < v1
    int v1 = 0;
    int side0 = 0;
    int side1 = -1;  // -1 at a border; an edge with more than two faces is listed again
  };
  Triangles triangles;      // 3xT
  std::vector<Edge> edges;  // ordered by (v0, v1)
  // Triangles around vertex v: vertex_triangles[vertex_begin[v]] to [vertex_begin[v + 1]].
  std::vector<int> vertex_begin;  // V+1
  std::vector<int> vertex_triangles;

  // Vertices at the same position in `mesh` (UV seams split them) become one, the first of them.
  // Throws Error (kInvalidArgument) for a mesh that does not validate. O(T log T).
  static SurfaceTopology FromMesh(const TriangleMesh& mesh);
};

// M: every pixel that any triangle covers, exactly RasterizeMesh's. Reuses *mask when it has the
// size already. Throws Error (kInvalidArgument) for positions that do not fit the topology and as
// RasterizeMesh.
void ModelMask(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
               const SurfaceTopology& topology, cv::Mat* mask);

// R: limbs of `thickness` times the capsules' radii, at least one pixel wide, where `model` (M) is
// set. thickness: 1/3 ours; 0 draws the bones as lines, as in the paper.
// Throws Error (kInvalidArgument) for a negative thickness or radius, or a mask of another size.
cv::Mat SkeletonMask(const Camera& camera, const CapsuleSet& capsules_in_camera, double thickness,
                     const cv::Mat& model);

}  // namespace mpc
