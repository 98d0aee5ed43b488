// Purpose: the vertices on the visible outline of a mesh, to be fitted to a silhouette.
// Source: paper, Section 5.2, "model boundary"; what counts as one: docs/render.md.
// Frames: camera frame; pixel centres at integers. Units: metres, pixels. Symbols: P points.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/render/model_mask.h"
#include "mpc/render/raster.h"

namespace mpc {

struct ModelBoundary {
  std::vector<int> vertices;  // P, increasing; of vertices at one position the first
  Eigen::Matrix2Xd pixels;    // 2xP, where they project
  Eigen::Matrix2Xd normals;   // 2xP, unit, pointing out of the silhouette
};

struct BoundaryOptions {
  // Rim vertices whose unit normal is shorter than this across the viewing ray are left out: they
  // face the camera and say nothing about the outline. Ours.
  double min_projected_normal = 0.2;
};

// The vertices on edges between a triangle that faces the camera and one that does not, and on open
// edges, that lie on the border of `mask`: both kinds of pixel among the 3 x 3 around them, and two
// pixels along the normal outside. Outlines inside the mask (an arm before the trunk) and the
// picture's own border do not count. `depth` (RasterizeMesh) also drops what lies hidden behind the
// outline; when empty nothing is dropped. Normals are those of the surface, on open edges those of
// the edge in the picture.
//
// mask: CV_8UC1, depth: CV_32F or empty, both of the camera's size. Throws Error
// (kInvalidArgument) for other images and as ModelMask. O(V + T).
ModelBoundary FindModelBoundary(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                                const SurfaceTopology& topology, const cv::Mat& mask,
                                const cv::Mat& depth, const BoundaryOptions& options = {});

// Buffers of DrawModelBoundary; reuse them over frames, one per thread.
struct BoundaryBuffers {
  cv::Mat mask;
  RasterBuffers raster;
};

// The same of M itself, at several times the speed: everything is drawn once, in the mesh's part of
// the picture only, and depth only next to the outline. drop_hidden: as with a depth image.
ModelBoundary DrawModelBoundary(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                                const SurfaceTopology& topology, bool drop_hidden,
                                BoundaryBuffers* buffers, const BoundaryOptions& options = {});

}  // namespace mpc
