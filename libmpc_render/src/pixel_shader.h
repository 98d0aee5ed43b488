// Purpose: the light that pixels get from a triangle.
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

  // Adds linear light (4 floats each) to the pixels (x, y), (x + 1, y), ... where triangle `t` is seen
  // at these depths.
  void Add(int t, int x, int y, int count, const float* depth, float* sum);

 private:
  using Lanes = LampView::Lanes;  // a value for each of kShadedTogether pixels in a row

  struct Triangle {
    int id = -1;
    const LitMesh* mesh = nullptr;
    bool smooth = false;
    Eigen::Vector3d weight_sum;      // . (x, y, 1) = sum of the corners' weights
    Eigen::Matrix<double, 2, 3> uv;  // . (x, y, 1) = uv times that sum
    Eigen::Matrix3d colour;          // likewise, linear b, g, r
    Eigen::Matrix3d normal;          // likewise
    Eigen::Array4f flat_colour;
    Eigen::Vector3f flat_normal;              // towards the camera
    std::vector<const LampView*> near_lamps;  // maps that may shade it
    float uv_area = 0;  // area in uv of a pixel, times the third power of the sum
  };

  void Prepare(int t, Triangle* triangle) const;
  // At most kShadedTogether pixels of the triangle.
  void AddFew(int x, int y, int count, const float* depth, float* sum) const;
  // Rows of colours (b, g, r, 0), one per pixel. `inverse` is one over the sum of the weights.
  using Colours = Eigen::Array<float, 4, kShadedTogether>;
  void Colour(const Eigen::Vector3d& at, int count, const Lanes& inverse, Colours* colours) const;
  // Unit, on the side that is seen.
  LampView::Points SmoothNormals(const Eigen::Vector3d& at, const Lanes& inverse) const;

  const Camera& camera_;
  const DrawList& list_;
  const LitScene& scene_;
  Eigen::Matrix3d ray_from_pixel_;
  Eigen::Vector3f up_, to_lamp_;       // unit, camera frame
  Eigen::Vector3f world_x_, world_z_;  // rows of world_from_camera
  Eigen::Vector3f eye_in_world_;
  Eigen::Array4f lamp_, sky_, ground_;
  std::vector<LampView> lamps_;

  std::vector<Triangle> prepared_;  // those seen last: the same ones come in every row
  const Triangle* now_ = nullptr;   // that is shaded
};

}  // namespace mpc
