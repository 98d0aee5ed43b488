// Purpose: the light that a pixel gets from a triangle.
// Frames: camera frame. Everything a triangle carries is a quotient of two functions that are linear
// in the picture: with ray = ((x - cx) / fx, (y - cy) / fy, 1) and corners x0, x1, x2 the corners'
// weights are proportional to (x1 x x2) . ray and so on.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/render/lit_scene.h"

namespace mpc {

// The meshes of one layer as one, in the camera's frame.
struct DrawList {
  Eigen::Matrix3Xf positions;  // 3xV
  Triangles triangles;         // 3xT
  std::vector<int> mesh_of;    // T
  std::vector<const LitMesh*> meshes;
  std::vector<int> first_vertex;  // per mesh
};
DrawList MakeDrawList(const Camera& camera, const std::vector<const LitMesh*>& meshes);

class PixelShader {
 public:
  PixelShader(const Camera& camera, const DrawList& list, const LitScene& scene);

  // Linear light of the pixel (x, y) where triangle `t` is seen at depth z.
  Eigen::Array4f Shade(int t, int x, int y, float z) {
    if (t != known_) SetUp(t);
    return ShadeKnown(x, y, z);
  }

 private:
  void SetUp(int t);
  Eigen::Array4f ShadeKnown(int x, int y, float z) const;
  // w: one over the sum of the corners' weights.
  Eigen::Array4f Colour(const Eigen::Vector3d& at, double w) const;
  // Of sky and ground on a surface with this normal.
  Eigen::Array4f Surroundings(const Eigen::Vector3f& normal) const;
  Eigen::Vector3f SmoothNormal(const Eigen::Vector3d& at, double w) const;

  const Camera& camera_;
  const DrawList& list_;
  const LitScene& scene_;
  Eigen::Matrix3d ray_from_pixel_;
  Eigen::Vector3f up_, to_lamp_;       // unit, camera frame
  Eigen::Vector3f world_x_, world_z_;  // rows of world_from_camera
  Eigen::Vector3f eye_in_world_;
  Eigen::Array4f lamp_, sky_, ground_;
  std::vector<LampView> lamps_;

  // Of the triangle known_.
  int known_ = -1;
  const LitMesh* mesh_ = nullptr;
  Eigen::Vector3d weight_sum_;      // . (x, y, 1) = sum of the corners' weights
  Eigen::Matrix<double, 2, 3> uv_;  // . (x, y, 1) = uv times that sum
  Eigen::Matrix3d colour_;          // likewise, linear b, g, r
  Eigen::Matrix3d normal_;          // likewise
  Eigen::Array4f flat_colour_;
  Eigen::Vector3f flat_normal_;              // towards the camera
  Eigen::Array4f flat_surroundings_;         // for that normal
  std::vector<const LampView*> near_lamps_;  // maps that may shade it
  double uv_area_ = 0;  // area in uv of a pixel, times the third power of the sum
};

}  // namespace mpc
