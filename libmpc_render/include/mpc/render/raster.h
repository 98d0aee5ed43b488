// Purpose: which triangle or capsule is seen in each pixel, and how far away.
// Frames: camera frame (x right, y down, z forward); pixel centres at integers.
// Units: metres, pixels. Symbols: V vertices, T triangles.
//
// Coverage is exact: vertices are snapped to 1/256 px and pixels on a shared edge belong to one
// triangle (top-left rule), so a closed mesh has neither holes nor pixels drawn twice. Triangles
// are two-sided and clipped at the near plane. Lens distortion moves vertices, edges stay straight.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "mpc/core/camera.h"
#include "mpc/core/capsule_set.h"
#include "mpc/core/triangle_mesh.h"

namespace mpc {

struct RasterOptions {
  double near_m = 0.01;      // nothing closer is drawn, m; ours
  bool barycentric = false;  // also fill RasterBuffers::barycentric
};

// Images of the camera's size; reused when they have it already.
struct RasterBuffers {
  cv::Mat depth;        // CV_32F: z in the camera frame, m; 0 where nothing is seen
  cv::Mat triangle_id;  // CV_32S: index of the triangle (or capsule) seen, -1 where none
  cv::Mat barycentric;  // CV_32FC2: weights of the triangle's first two vertices, perspective-
                        // correct; meaningful where triangle_id >= 0
};

// Draws the nearest triangle into every pixel; of equally near ones the first. positions_in_camera
// is 3xV; triangles with a vertex that is not finite, or that lies outside the lens model's range,
// are left out. Throws Error (kInvalidArgument) for a vertex index out of range, a bad camera, or a
// picture side above 16384. O(T + pixels); thread-safe for different buffers.
void RasterizeMesh(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                   const Triangles& triangles, const RasterOptions& options,
                   RasterBuffers* buffers);

// Picks AVX2 at run time where the machine has it; the plain twin gives the same bits.
void RasterizeMeshScalar(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                         const Triangles& triangles, const RasterOptions& options,
                         RasterBuffers* buffers);

// The same for limbs: the convex hull of both end spheres, as a fine mesh (0.5 % of the radius).
// triangle_id holds the capsule's index. Radii must not be negative.
void RasterizeCapsules(const Camera& camera, const CapsuleSet& capsules_in_camera,
                       const RasterOptions& options, RasterBuffers* buffers);

// Silhouettes as 8-bit images of the camera's size, 255 inside. For a mesh that is drawn more than
// once see mpc/render/model_mask.h.
cv::Mat MeshMask(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                 const Triangles& triangles);
cv::Mat CapsuleMask(const Camera& camera, const CapsuleSet& capsules_in_camera);

// The part of the picture that a mesh can cover, clipped to the picture and possibly empty; the
// whole picture when a vertex lies behind the near plane.
cv::Rect ProjectedBounds(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                         double near_m = 0.01);

// The camera whose picture is the part `rect` of this camera's picture.
Camera CroppedTo(const Camera& camera, const cv::Rect& rect);

}  // namespace mpc
