#include "mpc/deform/surface_contour_energy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr double kLongSide_px = 1920;

void CheckSizes(const DeformationGraph& graph, const Eigen::Matrix3Xf& posed,
                const Correspondences& correspondences) {
  const int count = correspondences.size();
  if (posed.cols() != graph.num_vertices() || correspondences.targets.cols() != count ||
      correspondences.normals.cols() != count || correspondences.weights.size() != count) {
    throw Error(
        ErrorCode::kInvalidArgument,
        fmt::format("surface energy: {} vertices for a graph of {}, {} correspondences with "
                    "{} targets, {} normals and {} weights",
                    posed.cols(), graph.num_vertices(), count, correspondences.targets.cols(),
                    correspondences.normals.cols(), correspondences.weights.size()));
  }
  for (const int v : correspondences.vertices) {
    if (v >= 0 && v < posed.cols()) continue;
    throw Error(
        ErrorCode::kInvalidArgument,
        fmt::format("surface energy: a correspondence of vertex {} of {}", v, posed.cols()));
  }
  if (count > 0 && correspondences.num_boundary <= 0) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("surface energy: {} correspondences of {} boundary vertices", count,
                            correspondences.num_boundary));
  }
}

}  // namespace

SurfaceContourEnergy::SurfaceContourEnergy(const Camera& camera, const DeformationGraph& graph,
                                           const Eigen::Matrix3Xf& posed,
                                           const Correspondences& correspondences)
    : camera_(camera) {
  CheckSizes(graph, posed, correspondences);
  const double scale = kLongSide_px / std::max(camera.width, camera.height);
  for (int c = 0; c < correspondences.size(); ++c) {
    const int v = correspondences.vertices[c];
    const double weight = correspondences.weights[c] / correspondences.num_boundary;
    Pair pair;
    pair.posed = posed.col(v).cast<double>();
    pair.target = correspondences.targets.col(c);
    pair.scaled_normal = std::sqrt(weight) * scale * correspondences.normals.col(c);
    pair.begin = static_cast<int>(nodes_.size());
    pair.count = 0;
    for (; pair.count < graph.weights.rows() && graph.weights(pair.count, v) > 0; ++pair.count) {
      const int node = graph.influences(pair.count, v);
      nodes_.push_back(node);
      shares_.push_back(graph.weights(pair.count, v));
      levers_.emplace_back(pair.posed - posed.col(graph.node_vertices[node]).cast<double>());
    }
    pairs_.push_back(pair);
  }
}

std::span<const int> SurfaceContourEnergy::nodes(int block) const {
  return {nodes_.data() + pairs_[block].begin, static_cast<size_t>(pairs_[block].count)};
}

bool SurfaceContourEnergy::Evaluate(const WarpField& at, int block, double* r,
                                    BlockJacobian* jacobian) const {
  const Pair& pair = pairs_[block];
  Eigen::Vector3d moved = pair.posed;
  std::array<Eigen::Vector3d, kMaxBlockNodes> turned;
  for (int k = 0; k < pair.count; ++k) {
    const int node = nodes_[pair.begin + k];
    const Eigen::Vector3d& lever = levers_[pair.begin + k];
    turned[k] = at.rotations[node] * lever;
    moved += shares_[pair.begin + k] * (turned[k] - lever + at.translations.col(node));
  }
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> by_point;
  if (!Project(camera_, moved, &pixel, jacobian == nullptr ? nullptr : &by_point)) return false;
  *r = pair.scaled_normal.dot(pixel - pair.target);
  if (jacobian == nullptr) return true;
  const Eigen::Vector3d gradient = by_point.transpose() * pair.scaled_normal;
  jacobian->resize(1, 6 * pair.count);
  for (int k = 0; k < pair.count; ++k) {
    const Eigen::Vector3d share = shares_[pair.begin + k] * gradient;
    jacobian->block<1, 3>(0, 6 * k) = turned[k].cross(share).transpose();
    jacobian->block<1, 3>(0, 6 * k + 3) = share.transpose();
  }
  return true;
}

}  // namespace mpc
