// Purpose: a picture that covers a mesh: charts, their places in the picture, and its painting from
// a function of the surface.
// Frames: the mesh's own. Units: those of the mesh; pictures in texels. Symbols: V vertices, T
// triangles.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

// Triangles laid out flat.
struct FlatTriangles {
  std::vector<int> chart;                           // T; charts are numbered from 0
  std::vector<Eigen::Matrix<float, 2, 3>> corners;  // T: where the three corners lie in the chart
};

// Cuts a surface into pieces that look along one axis each and projects them along it. `group`
// (T): pieces never reach over two groups.
FlatTriangles ProjectAlongAxes(const TriangleMesh& mesh, const std::vector<int>& group);

struct TextureAtlas {
  int size = 0;             // side of the picture
  std::vector<int> source;  // V': vertex of the mesh each vertex comes from; seams split vertices
  Triangles triangles;      // 3xT, of the split vertices, in the old order
  Eigen::Matrix2Xf uv;      // 2xV', glTF convention
};

// Packs the charts; `scale` per chart, relative to the others. The first copies of the vertices
// come first, in their old order.
TextureAtlas PackAtlas(const FlatTriangles& flat, const Triangles& triangles, int num_vertices,
                       const std::vector<float>& scale, int size);

// Paints every texel that the surface covers, and some around: colour(triangle, barycentric) is
// asked at the texel's place. CV_8UC3.
cv::Mat PaintAtlas(
    const TextureAtlas& atlas,
    const std::function<cv::Vec3b(int triangle, const Eigen::Vector3f& barycentric)>& colour);

}  // namespace mpc
