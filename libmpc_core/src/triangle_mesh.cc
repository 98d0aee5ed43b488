#include "mpc/core/triangle_mesh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cstdint>
#include <numeric>

#include "mpc/core/error.h"

namespace mpc {

void TriangleMesh::Validate() const {
  for (Eigen::Index v = 0; v < positions.cols(); ++v) {
    if (!positions.col(v).allFinite()) {
      throw Error(ErrorCode::kInvalidArgument,
                  fmt::format("mesh: the position of vertex {} is not finite", v));
    }
  }
  for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
    for (const int v : triangles.col(t)) {
      if (v < 0 || v >= positions.cols()) {
        throw Error(ErrorCode::kInvalidArgument,
                    fmt::format("mesh: triangle {} uses vertex {} of {}", t, v, positions.cols()));
      }
    }
  }
}

std::vector<MeshEdge> MeshEdges(const Triangles& triangles) {
  struct Side {
    int v0, v1, face;
    auto operator<=>(const Side&) const = default;
  };
  std::vector<Side> sides;
  sides.reserve(static_cast<size_t>(3 * triangles.cols()));
  for (int t = 0; t < triangles.cols(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const auto [v0, v1] = std::minmax({triangles(k, t), triangles((k + 1) % 3, t)});
      if (v0 != v1) sides.push_back({v0, v1, t});
    }
  }
  std::sort(sides.begin(), sides.end());

  std::vector<MeshEdge> edges;
  for (const Side& side : sides) {
    if (edges.empty() || edges.back().v0 != side.v0 || edges.back().v1 != side.v1) {
      edges.push_back({side.v0, side.v1, {side.face, -1}});
    } else if (edges.back().faces[1] < 0) {
      edges.back().faces[1] = side.face;
    }
  }
  return edges;
}

std::vector<int> WeldedVertices(const Eigen::Matrix3Xf& positions) {
  const auto bits = [&](int v) {
    return std::array<std::uint32_t, 3>{std::bit_cast<std::uint32_t>(positions(0, v)),
                                        std::bit_cast<std::uint32_t>(positions(1, v)),
                                        std::bit_cast<std::uint32_t>(positions(2, v))};
  };
  std::vector<int> order(static_cast<size_t>(positions.cols()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return bits(a) < bits(b); });

  std::vector<int> welded(order.size());
  int first = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || bits(order[i]) != bits(first)) first = order[i];
    welded[static_cast<size_t>(order[i])] = first;
  }
  return welded;
}

void VertexNormals(const Eigen::Matrix3Xf& positions, const Triangles& triangles,
                   Eigen::Matrix3Xf* normals) {
  normals->setZero(3, positions.cols());
  for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
    const Eigen::Vector3f a = positions.col(triangles(0, t));
    const Eigen::Vector3f b = positions.col(triangles(1, t));
    const Eigen::Vector3f c = positions.col(triangles(2, t));
    const Eigen::Vector3f twice_area = (b - a).cross(c - a);
    for (int k = 0; k < 3; ++k) normals->col(triangles(k, t)) += twice_area;
  }
  for (Eigen::Index v = 0; v < normals->cols(); ++v) normals->col(v).stableNormalize();
}

}  // namespace mpc
