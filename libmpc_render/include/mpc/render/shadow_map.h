// Purpose: where a lamp does not shine because something is in the way, and where a floor is dark
// because something stands on it.
// Source: shadow maps after Williams 1978, with percentage-closer filtering (Reeves et al. 1987).
// Frames: world, y up for ContactMap. Units: metres.
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <span>

#include "mpc/core/camera.h"
#include "mpc/core/triangle_mesh.h"

namespace mpc {

// What a lamp sees of one group of bodies. The map is as large as the bodies look from there:
// points that no ray through them reaches are lit.
struct ShadowMap {
  Camera lamp;    // at the lamp, looking at the bodies; width 0: of no body
  cv::Mat depth;  // CV_32F as RasterBuffers::depth
  // CV_32FC2: the nearest and the farthest depth of each block of 16 x 16 texels and those beside
  // it, where nothing is seen infinite: whether a point is lit can mostly be told from it.
  cv::Mat blocks;
  cv::Mat wide_blocks;  // the same of each block and its eight neighbours
};

inline constexpr float kShadowBiasM = 0.01f;  // nothing shades what lies this close behind it

// side_px: of the map, which is square. The lamp must lie outside of the bodies: throws Error
// (kInvalidArgument) when it does not.
ShadowMap MakeShadowMap(const Eigen::Vector3d& lamp_in_world,
                        std::span<const TriangleMesh* const> bodies, int side_px);

inline constexpr int kShadedTogether = 8;  // points, for the processor's vector instructions

// A shadow map to be asked many times, for points given in one frame.
class LampView {
 public:
  using Lanes = Eigen::Array<float, kShadedTogether, 1>;
  using Points = std::array<Lanes, 3>;  // coordinates of points

  // `map` must outlive the view. camera_from_world: of the frame the points are in.
  LampView(const ShadowMap& map, const CameraFromWorld& camera_from_world);

  // Multiplies each light by the part of the lamp that is seen from its point, 0 to 1: bilinear
  // between the answers of four neighbours.
  void Shade(const Points& x, Lanes* light) const;

  // No point of the triangle between these corners lies within the map: all of it is lit.
  bool Misses(const Eigen::Matrix3f& corners) const;

 private:
  // When the points lie so near one another that a wide block tells all their answers; else false.
  bool ShadeTogether(const Lanes& u, const Lanes& v, const Lanes& depth, Lanes* light) const;

  const cv::Mat* depth_;
  const cv::Mat* blocks_;
  const cv::Mat* wide_blocks_;
  Eigen::Matrix3f pixel_from_point_;
  Eigen::Vector3f offset_;
  float last_;  // column and row
};

// How much of the sky the bodies near the floor y = 0 take away from it: 0 none, 1 all.
struct ContactMap {
  cv::Mat darkness;    // CV_32F, row along z, column along x
  float x_begin = 0;   // of column 0's centre
  float z_begin = 0;   // of row 0's centre
  float per_cell = 1;  // cells per metre

  // Bilinear; 0 beyond the map. Thread-safe.
  float At(float x, float z) const;
};

ContactMap MakeContactMap(std::span<const TriangleMesh* const> bodies);

}  // namespace mpc
