#include "mpc/eval/closest_point.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "mpc/core/error.h"

namespace mpc {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kLeafSize = 4;
constexpr size_t kMaxDepth = 64;  // halves at every level, so far below
constexpr double kFlat = 1e-20;   // squared sine of an angle that counts as none

double SegmentDistance(const Vector3d& point, const Vector3d& a, const Vector3d& b) {
  const Vector3d ab = b - a, ap = point - a;
  const double squared_length = ab.squaredNorm();
  const double along = squared_length > 0 ? ap.dot(ab) / squared_length : 0;
  if (along <= 0) return ap.norm();
  return along >= 1 ? (point - b).norm() : (ap - along * ab).norm();
}

double SquaredDistanceToBox(const Vector3d& point, const Vector3f& low, const Vector3f& high) {
  const Vector3d outside =
      (low.cast<double>() - point).cwiseMax(point - high.cast<double>()).cwiseMax(Vector3d::Zero());
  return outside.squaredNorm();
}

}  // namespace

double TriangleDistance(const Vector3d& point, const Vector3d& a, const Vector3d& b,
                        const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a, ap = point - a;
  // Without an inside there are only edges, and the regions below mean nothing.
  if (ab.cross(ac).squaredNorm() <= kFlat * ab.squaredNorm() * ac.squaredNorm()) {
    return std::min(
        {SegmentDistance(point, a, b), SegmentDistance(point, a, c), SegmentDistance(point, b, c)});
  }
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return ap.norm();
  const Vector3d bp = point - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return bp.norm();
  const Vector3d cp = point - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return cp.norm();
  // Twice the signed areas towards each corner; negative beyond the opposite edge.
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return (ap - d1 / (d1 - d3) * ab).norm();
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return (ap - d2 / (d2 - d6) * ac).norm();
  const double va = d3 * d6 - d5 * d4;
  const double along = (d4 - d3) / ((d4 - d3) + (d5 - d6));
  if (va <= 0 && d4 >= d3 && d5 >= d6) return (bp - along * (c - b)).norm();
  const double scale = 1 / (va + vb + vc);
  return (ap - vb * scale * ab - vc * scale * ac).norm();
}

SurfaceTree::SurfaceTree(const Eigen::Matrix3Xf& positions, const Triangles& triangles) {
  TriangleMesh{positions, triangles}.Validate();
  if (triangles.cols() == 0) {
    throw Error(ErrorCode::kInvalidArgument, "a surface without triangles has no nearest point");
  }
  const auto count = static_cast<size_t>(triangles.cols());
  corners_.reserve(3 * count);
  centres_.reserve(count);
  for (const auto& triangle : triangles.colwise()) {
    for (const int v : triangle) corners_.emplace_back(positions.col(v));
    const Vector3f* corner = &corners_[corners_.size() - 3];
    centres_.emplace_back((corner[0] + corner[1] + corner[2]) / 3);
  }
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(2 * count);
  Build(0, static_cast<int>(count));
  centres_ = {};
}

int SurfaceTree::Build(int begin, int end) {
  const auto index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  Vector3f low = Vector3f::Constant(std::numeric_limits<float>::infinity());
  Vector3f high = -low, centre_low = low, centre_high = high;
  for (int i = begin; i < end; ++i) {
    const auto triangle = static_cast<size_t>(order_[static_cast<size_t>(i)]);
    for (size_t k = 0; k < 3; ++k) {
      low = low.cwiseMin(corners_[3 * triangle + k]);
      high = high.cwiseMax(corners_[3 * triangle + k]);
    }
    centre_low = centre_low.cwiseMin(centres_[triangle]);
    centre_high = centre_high.cwiseMax(centres_[triangle]);
  }
  Node node{.low = low, .high = high, .begin = begin, .count = end - begin};
  if (node.count > kLeafSize) {
    Eigen::Index axis = 0;
    (centre_high - centre_low).maxCoeff(&axis);
    const int middle = begin + node.count / 2;
    std::nth_element(
        order_.begin() + begin, order_.begin() + middle, order_.begin() + end, [&](int a, int b) {
          return centres_[static_cast<size_t>(a)][axis] < centres_[static_cast<size_t>(b)][axis];
        });
    node.count = 0;
    Build(begin, middle);
    node.right = Build(middle, end);
  }
  nodes_[static_cast<size_t>(index)] = node;
  return index;
}

double SurfaceTree::DistanceToTriangle(const Vector3d& point, int triangle) const {
  const Vector3f* corner = &corners_[3 * static_cast<size_t>(triangle)];
  return TriangleDistance(point, corner[0].cast<double>(), corner[1].cast<double>(),
                          corner[2].cast<double>());
}

double SurfaceTree::Distance(const Vector3d& point, int* hint) const {
  int nearest = hint != nullptr ? *hint : order_[0];
  double best = DistanceToTriangle(point, nearest);
  struct Visit {
    int node;
    double squared_distance;
  };
  std::array<Visit, kMaxDepth> stack;
  size_t size = 0;
  stack[size++] = {0, 0};
  while (size > 0) {
    const Visit visit = stack[--size];
    if (visit.squared_distance >= best * best) continue;
    const Node& node = nodes_[static_cast<size_t>(visit.node)];
    for (int i = node.begin; i < node.begin + node.count; ++i) {
      const int triangle = order_[static_cast<size_t>(i)];
      const double distance = DistanceToTriangle(point, triangle);
      if (distance < best) best = distance, nearest = triangle;
    }
    if (node.count > 0) continue;
    const auto child = [&](int c) {
      const Node& box = nodes_[static_cast<size_t>(c)];
      return Visit{c, SquaredDistanceToBox(point, box.low, box.high)};
    };
    Visit near = child(visit.node + 1), far = child(node.right);
    if (far.squared_distance < near.squared_distance) std::swap(near, far);
    stack[size++] = far;
    stack[size++] = near;
  }
  if (hint != nullptr) *hint = nearest;
  return best;
}

}  // namespace mpc
