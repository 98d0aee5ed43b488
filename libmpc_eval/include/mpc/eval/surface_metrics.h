// Purpose: how far a captured surface is from the true one.
// Source: paper, Results: "we aligned the reconstruction to the ground truth with a translation to
// eliminate the global depth offsets": ONE translation for a whole clip.
// Frames: any, the same for both; the camera frame, when the camera moves. Units: inputs metres,
// results mm. Symbols: V vertices, T triangles.
//
// A clip is compared in two passes, frame by frame, so that it need not be held: the mean over its
// frames of MeanOffset is the translation that minimises the squared vertex distances of all of
// them; with it CompareSurfaces scores each frame. All functions are pure, thread-safe and throw
// Error (kMismatch) for different numbers of vertices.
#pragma once

#include <Eigen/Core>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

// Mean over the vertices of truth - estimate, both 3xV, V > 0.
Eigen::Vector3d MeanOffset(const Eigen::Matrix3Xf& estimate, const Eigen::Matrix3Xf& truth);

struct SurfaceError {
  double vertex_mm = 0;   // mean distance of a vertex from the same vertex of the truth
  double surface_mm = 0;  // mean of: distance of a vertex from the true surface, mean over the
      // vertices; distance of a true vertex from the estimated surface, likewise
};

// The estimate, moved by `translation`, against the truth, V > 0. `surface_mm` costs two nearest
// neighbour trees, O((V + T) log T). Throws Error (kInvalidArgument) as SurfaceTree.
SurfaceError CompareSurfaces(const Eigen::Matrix3Xf& estimate, const Eigen::Matrix3Xf& truth,
                             const Triangles& triangles, const Eigen::Vector3d& translation);

// vertex_mm alone.
double MeanVertexDistanceMm(const Eigen::Matrix3Xf& estimate, const Eigen::Matrix3Xf& truth,
                            const Eigen::Vector3d& translation);

}  // namespace mpc
