// Purpose: plain pictures of a mesh: a lamp at the camera, Lambert's law, no shadows.
// Frames: camera frame. Colours: BGR, 0 to 255. Symbols: V vertices, T triangles.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/triangle_mesh.h"

namespace mpc {

// Colour of a surface. The first of these that a triangle has counts: texture, vertex colours,
// triangle colours, one colour.
struct MeshAppearance {
  std::vector<cv::Mat> textures;      // CV_8UC3, or empty for triangles without; need uv
  std::vector<int> triangle_texture;  // T, indices into textures; empty: all have the first
  Eigen::Matrix2Xf uv;            // 2xV, glTF convention: (0, 0) is the texture's top left corner
  Eigen::Matrix3Xf vertex_bgr;    // 3xV
  Eigen::Matrix3Xf triangle_bgr;  // 3xT
  cv::Vec3f bgr = {200, 200, 200};
  double ambient = 0.35;  // light on a surface seen edge-on, 0 to 1; 1 is unshaded
};

// Draws the mesh over `image` (CV_8UC3 of the camera's size) with opacity alpha in [0, 1].
// Throws Error (kInvalidArgument) for images or colours of the wrong size and as RasterizeMesh.
void ShadeMesh(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
               const Triangles& triangles, const MeshAppearance& appearance, double alpha,
               cv::Mat* image);

}  // namespace mpc
