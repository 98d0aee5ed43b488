#include "mpc/render/model_mask.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "mpc/core/error.h"
#include "mpc/render/raster.h"
#include "outline.h"
#include "winding_image.h"

namespace mpc {

SurfaceTopology SurfaceTopology::FromMesh(const TriangleMesh& mesh) {
  mesh.Validate();
  SurfaceTopology topology;
  const std::vector<int> welded = WeldedVertices(mesh.positions);
  topology.triangles =
      mesh.triangles.unaryExpr([&](int v) { return welded[static_cast<size_t>(v)]; });
  const Triangles& triangles = topology.triangles;

  std::vector<std::array<int, 3>> sides;  // v0, v1, side
  sides.reserve(static_cast<size_t>(3 * triangles.cols()));
  for (int t = 0; t < triangles.cols(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int from = triangles(k, t), to = triangles((k + 1) % 3, t);
      if (from != to)
        sides.push_back({std::min(from, to), std::max(from, to), 2 * t + (from > to)});
    }
  }
  std::sort(sides.begin(), sides.end());
  for (size_t i = 0; i < sides.size();) {
    const auto [v0, v1, side] = sides[i++];
    const bool paired = i < sides.size() && sides[i][0] == v0 && sides[i][1] == v1;
    topology.edges.push_back({v0, v1, side, paired ? sides[i++][2] : -1});
  }

  topology.vertex_begin.assign(welded.size() + 1, 0);
  for (const int v : triangles.reshaped()) ++topology.vertex_begin[static_cast<size_t>(v) + 1];
  for (size_t v = 0; v < welded.size(); ++v) {
    topology.vertex_begin[v + 1] += topology.vertex_begin[v];
  }
  std::vector<int> next = topology.vertex_begin;
  topology.vertex_triangles.resize(static_cast<size_t>(triangles.size()));
  for (int t = 0; t < triangles.cols(); ++t) {
    for (const int v : triangles.col(t)) {
      topology.vertex_triangles[static_cast<size_t>(next[static_cast<size_t>(v)]++)] = t;
    }
  }
  return topology;
}

void ModelMask(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
               const SurfaceTopology& topology, cv::Mat* mask) {
  const Outline outline =
      ComputeOutline(camera, positions_in_camera, topology, RasterOptions().near_m);
  DrawOutlineMask(camera, positions_in_camera, topology, outline, mask);
}

void DrawOutlineMask(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                     const SurfaceTopology& topology, const Outline& outline, cv::Mat* mask) {
  mask->create(camera.height, camera.width, CV_8UC1);
  mask->setTo(0);
  const cv::Rect bounds = ScreenBounds(camera, outline.vertices);
  if (bounds.empty()) return;
  WindingImage winding(bounds);
  for (const SurfaceTopology::Edge& edge : topology.edges) {
    const int weight = outline.Weight(edge);
    if (weight == 0) continue;
    winding.AddEdge(outline.vertices[static_cast<size_t>(edge.v0)],
                    outline.vertices[static_cast<size_t>(edge.v1)], weight);
  }
  for (const int t : outline.clipped) {
    winding.AddFan(ClippedTriangle(camera, positions_in_camera, topology.triangles.col(t),
                                   RasterOptions().near_m));
  }
  winding.Resolve((*mask)(bounds));
}

}  // namespace mpc
