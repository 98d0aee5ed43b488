// Purpose: pictures of textured bodies in a place, lit by one far lamp and the sky, with shadows.
// Source: ours. Lambert's law in linear light (mpc/render/texture.h).
// Frames: world, y up. Units: metres. Symbols: V vertices, T triangles.
//
// A scene has two layers: the place, and in front of it the bodies. Inside a layer the nearest
// surface is seen; the bodies always hide the place, so that a foot that sinks into the floor by a
// millimetre is seen whole.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/triangle_mesh.h"
#include "mpc/render/shadow_map.h"
#include "mpc/render/texture.h"

namespace mpc {

struct LitMesh {
  TriangleMesh mesh;         // in the world
  Eigen::Matrix3Xf normals;  // 3xV unit normals; empty: flat triangles
  Eigen::Matrix2Xf uv;       // 2xV, with a texture
  std::shared_ptr<const Texture> texture;
  Eigen::Matrix3Xf vertex_bgr;      // 3xV, 0 to 255, without a texture
  cv::Vec3f bgr = {200, 200, 200};  // without either; multiplies neither
  bool glows = false;               // unlit: a sky, a lamp
  bool is_floor = false;            // darkened by contact
};

struct Lighting {
  Eigen::Vector3d lamp_in_world = {10, 30, 20};       // far from everything
  Eigen::Array3f lamp_bgr = {0.75f, 0.8f, 0.85f};     // light on a surface that faces it, linear
  Eigen::Array3f sky_bgr = {0.45f, 0.42f, 0.38f};     // on a surface that faces up
  Eigen::Array3f ground_bgr = {0.18f, 0.18f, 0.18f};  // on one that faces down
};

struct LitScene {
  std::vector<const LitMesh*> place;
  std::vector<const LitMesh*> bodies;
  Lighting lighting;
  std::vector<const ShadowMap*> shadows;  // of the lamp
  const ContactMap* contact = nullptr;
  cv::Mat part;  // CV_8UC1 of the picture's size: only pixels that are not 0 are drawn; empty: all
};

// Adds the scene's picture to `sum` (CV_32FC4: linear b, g, r, and 0) of the camera's size; black
// where nothing is. Throws Error (kInvalidArgument) for a camera with distortion or without
// extrinsics, sizes that do not fit, and as RasterizeMesh. Thread-safe for different sums.
void AddLitPicture(const Camera& camera, const LitScene& scene, cv::Mat* sum);

// Points of the world in a camera's frame, computed in double: the same bits everywhere.
Eigen::Matrix3Xf ToCamera(const CameraFromWorld& camera_from_world,
                          const Eigen::Matrix3Xf& x_in_world);

// The 8-bit BGR picture of linear light that was added up `count` times. Light above 1 saturates.
cv::Mat Developed(const cv::Mat& sum, int count);

}  // namespace mpc
