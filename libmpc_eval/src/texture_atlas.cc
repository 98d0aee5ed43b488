#include "texture_atlas.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>

namespace mpc {
namespace {

constexpr int kChartMargin = 3;  // texels around a chart that are its own

// Triangles across the three edges, -1 at a border.
std::vector<std::array<int, 3>> Neighbours(const Triangles& triangles) {
  std::vector<std::array<int, 3>> neighbours(static_cast<size_t>(triangles.cols()), {-1, -1, -1});
  for (const MeshEdge& edge : MeshEdges(triangles)) {
    for (int side = 0; side < 2; ++side) {
      const int t = edge.faces[side];
      if (t < 0) continue;
      std::array<int, 3>& free = neighbours[t];
      *std::find(free.begin(), free.end() - 1, -1) = edge.faces[1 - side];
    }
  }
  return neighbours;
}

Eigen::Vector3f Normal(const TriangleMesh& mesh, int t) {
  const Eigen::Vector3f a = mesh.positions.col(mesh.triangles(0, t));
  const Eigen::Vector3f b = mesh.positions.col(mesh.triangles(1, t));
  const Eigen::Vector3f c = mesh.positions.col(mesh.triangles(2, t));
  return (b - a).cross(c - a).normalized();
}

// Numbers the connected pieces of equal label.
std::vector<int> Pieces(const std::vector<int>& label,
                        const std::vector<std::array<int, 3>>& neighbours);

// Label of each triangle: its group and the axis it looks along most, of 6; small pieces are given
// to their neighbours.
std::vector<int> AxisLabels(const TriangleMesh& mesh, const std::vector<int>& group,
                            const std::vector<std::array<int, 3>>& neighbours) {
  const int num_triangles = static_cast<int>(mesh.triangles.cols());
  std::vector<Eigen::Vector3f> normals;
  for (int t = 0; t < num_triangles; ++t) normals.push_back(Normal(mesh, t));
  const auto facing = [&](int t, int axis) {
    return (axis % 2 == 0 ? 1.0F : -1.0F) * normals[t][axis / 2];
  };
  std::vector<int> label(static_cast<size_t>(num_triangles), 0);
  for (int t = 0; t < num_triangles; ++t) {
    for (int axis = 1; axis < 6; ++axis) {
      if (facing(t, axis) > facing(t, label[t])) label[t] = axis;
    }
  }
  constexpr int kRounds = 8;
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<int> old = label;
    for (int t = 0; t < num_triangles; ++t) {
      std::array<int, 6> votes{};
      for (const int n : neighbours[t]) {
        if (n >= 0 && group[n] == group[t]) ++votes[old[n]];
      }
      const int best =
          static_cast<int>(std::max_element(votes.begin(), votes.end()) - votes.begin());
      if (votes[best] >= 2 && facing(t, best) > 0.25F) label[t] = best;
    }
  }
  for (int t = 0; t < num_triangles; ++t) label[t] += 6 * group[t];
  constexpr int kSmallPiece = 80;  // triangles
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<int> piece = Pieces(label, neighbours);
    std::vector<int> count(piece.size(), 0);
    for (const int p : piece) ++count[p];
    for (int t = 0; t < num_triangles; ++t) {
      if (count[piece[t]] >= kSmallPiece) continue;
      for (const int n : neighbours[t]) {
        if (n >= 0 && group[n] == group[t] && count[piece[n]] > count[piece[t]] &&
            facing(t, label[n] % 6) > 0.05F) {
          label[t] = label[n];
          break;
        }
      }
    }
  }
  return label;
}

std::vector<int> Pieces(const std::vector<int>& label,
                        const std::vector<std::array<int, 3>>& neighbours) {
  std::vector<int> piece(label.size(), -1);
  int num_pieces = 0;
  std::vector<int> open;
  for (int start = 0; start < static_cast<int>(label.size()); ++start) {
    if (piece[start] >= 0) continue;
    open.assign(1, start);
    piece[start] = num_pieces;
    while (!open.empty()) {
      const int t = open.back();
      open.pop_back();
      for (const int n : neighbours[t]) {
        if (n < 0 || piece[n] >= 0 || label[n] != label[t]) continue;
        piece[n] = num_pieces;
        open.push_back(n);
      }
    }
    ++num_pieces;
  }
  return piece;
}

struct ChartBox {
  Eigen::Vector2f low = Eigen::Vector2f::Constant(1e9F);
  Eigen::Vector2f high = Eigen::Vector2f::Constant(-1e9F);
  float scale = 1;
  Eigen::Vector2i texels(float density) const {
    return ((high - low) * scale * density).array().ceil().cast<int>() + 2 * kChartMargin + 1;
  }
};

// Rows of charts, tallest first; false when they do not fit.
bool PlaceCharts(const std::vector<ChartBox>& boxes, float density, int size,
                 std::vector<Eigen::Vector2i>* corners) {
  std::vector<int> order(boxes.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return boxes[a].texels(density).y() > boxes[b].texels(density).y();
  });
  corners->assign(boxes.size(), Eigen::Vector2i::Zero());
  int x = 0, y = 0, row = 0;
  for (const int i : order) {
    const Eigen::Vector2i texels = boxes[i].texels(density);
    if (texels.x() > size) return false;
    if (x + texels.x() > size) {
      y += row;
      x = row = 0;
    }
    if (y + texels.y() > size) return false;
    (*corners)[i] = {x, y};
    x += texels.x();
    row = std::max(row, texels.y());
  }
  return true;
}

}  // namespace

FlatTriangles ProjectAlongAxes(const TriangleMesh& mesh, const std::vector<int>& group) {
  const std::vector<std::array<int, 3>> neighbours = Neighbours(mesh.triangles);
  const std::vector<int> label = AxisLabels(mesh, group, neighbours);
  FlatTriangles flat;
  flat.chart = Pieces(label, neighbours);
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const int axis = label[t] % 6 / 2;
    // x and y lie as one looks at the piece; what matters is only that it does not fold.
    const int u = axis == 0 ? 2 : 0;
    const int v = axis == 1 ? 2 : 1;
    Eigen::Matrix<float, 2, 3> corners;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3f x = mesh.positions.col(mesh.triangles(i, t));
      corners.col(i) << x[u], -x[v];
    }
    flat.corners.push_back(corners);
  }
  return flat;
}

TextureAtlas PackAtlas(const FlatTriangles& flat, const Triangles& triangles, int num_vertices,
                       const std::vector<float>& scale, int size) {
  std::vector<ChartBox> boxes(scale.size());
  for (size_t t = 0; t < flat.chart.size(); ++t) {
    ChartBox& box = boxes[flat.chart[t]];
    box.scale = scale[flat.chart[t]];
    box.low = box.low.cwiseMin(flat.corners[t].rowwise().minCoeff());
    box.high = box.high.cwiseMax(flat.corners[t].rowwise().maxCoeff());
  }
  // The densest packing, by bisection.
  float fits = 0, too_dense = 8.0F * static_cast<float>(size);
  std::vector<Eigen::Vector2i> corners;
  for (int i = 0; i < 24; ++i) {
    const float density = 0.5F * (fits + too_dense);
    (PlaceCharts(boxes, density, size, &corners) ? fits : too_dense) = density;
  }
  PlaceCharts(boxes, fits, size, &corners);

  TextureAtlas atlas;
  atlas.size = size;
  atlas.source.resize(static_cast<size_t>(num_vertices));
  std::iota(atlas.source.begin(), atlas.source.end(), 0);
  atlas.triangles.resize(3, triangles.cols());
  std::vector<Eigen::Vector2f> uv(static_cast<size_t>(num_vertices), Eigen::Vector2f::Zero());
  std::vector<bool> used(static_cast<size_t>(num_vertices), false);
  std::map<std::tuple<int, float, float>, int> copies;
  for (int t = 0; t < triangles.cols(); ++t) {
    const ChartBox& box = boxes[flat.chart[t]];
    const Eigen::Vector2f corner =
        corners[flat.chart[t]].cast<float>().array() + kChartMargin + 0.5F;
    for (int i = 0; i < 3; ++i) {
      const int v = triangles(i, t);
      const Eigen::Vector2f place =
          (corner + (flat.corners[t].col(i) - box.low) * box.scale * fits) /
          static_cast<float>(size);
      const auto [it, is_new] = copies.try_emplace({v, place.x(), place.y()}, v);
      if (is_new) {
        if (used[v]) {
          it->second = static_cast<int>(uv.size());
          atlas.source.push_back(v);
          uv.push_back(place);
        } else {
          used[v] = true;
          uv[v] = place;
        }
      }
      atlas.triangles(i, t) = it->second;
    }
  }
  atlas.uv = Eigen::Map<const Eigen::Matrix2Xf>(uv.front().data(), 2,
                                                static_cast<Eigen::Index>(uv.size()));
  return atlas;
}

cv::Mat PaintAtlas(
    const TextureAtlas& atlas,
    const std::function<cv::Vec3b(int triangle, const Eigen::Vector3f& barycentric)>& colour) {
  cv::Mat picture(atlas.size, atlas.size, CV_8UC3, cv::Scalar(128, 128, 128));
  // Per texel: its triangle, where in it, and how far outside in texels.
  std::vector<int> triangle(static_cast<size_t>(atlas.size) * atlas.size, -1);
  std::vector<Eigen::Vector3f> place(triangle.size());
  std::vector<float> reach(triangle.size(), 1e9F);
  for (int t = 0; t < atlas.triangles.cols(); ++t) {
    Eigen::Matrix<float, 2, 3> p;
    for (int i = 0; i < 3; ++i) {
      p.col(i) = atlas.uv.col(atlas.triangles(i, t)) * static_cast<float>(atlas.size);
      p.col(i).array() -= 0.5F;
    }
    const Eigen::Vector2f e1 = p.col(1) - p.col(0);
    const Eigen::Vector2f e2 = p.col(2) - p.col(0);
    const float area = e1.x() * e2.y() - e1.y() * e2.x();
    if (std::abs(area) < 1e-6F) continue;
    const Eigen::Vector2i low =
        (p.rowwise().minCoeff().array() - kChartMargin).floor().cast<int>().cwiseMax(0);
    const Eigen::Vector2i high =
        (p.rowwise().maxCoeff().array() + kChartMargin).ceil().cast<int>().cwiseMin(atlas.size - 1);
    const float longest = std::max({e1.norm(), e2.norm(), (e2 - e1).norm()});
    for (int y = low.y(); y <= high.y(); ++y) {
      for (int x = low.x(); x <= high.x(); ++x) {
        const Eigen::Vector2f d = Eigen::Vector2f(x, y) - p.col(0);
        const float b1 = (d.x() * e2.y() - d.y() * e2.x()) / area;
        const float b2 = (e1.x() * d.y() - e1.y() * d.x()) / area;
        const Eigen::Vector3f b(1 - b1 - b2, b1, b2);
        // Height over an edge is about its barycentric times the triangle's height.
        const float outside = std::max(0.0F, -b.minCoeff()) * std::abs(area) / longest;
        const size_t i = static_cast<size_t>(y) * atlas.size + x;
        if (outside > kChartMargin || outside >= reach[i]) continue;
        reach[i] = outside;
        triangle[i] = t;
        place[i] = b.cwiseMax(0);
      }
    }
  }
  for (size_t i = 0; i < triangle.size(); ++i) {
    if (triangle[i] < 0) continue;
    picture.at<cv::Vec3b>(static_cast<int>(i)) = colour(triangle[i], place[i] / place[i].sum());
  }
  return picture;
}

}  // namespace mpc
