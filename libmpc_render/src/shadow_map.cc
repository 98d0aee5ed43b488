#include "mpc/render/shadow_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "mpc/core/error.h"
#include "mpc/render/raster.h"

namespace mpc {
namespace {

constexpr int kBlockPx = 16;
constexpr double kCellM = 0.025;        // of a contact map
constexpr double kBelowFloorM = 30;     // from where it is looked at: nearly parallel rays
constexpr double kContactReachM = 0.1;  // height at which a body's darkness has fallen to 1 / e
constexpr double kContactBlurM = 0.04;
constexpr float kContactStrength = 0.75f;

// The bodies as one mesh.
TriangleMesh Joined(std::span<const TriangleMesh* const> bodies) {
  Eigen::Index num_vertices = 0, num_triangles = 0;
  for (const TriangleMesh* body : bodies) {
    num_vertices += body->positions.cols();
    num_triangles += body->triangles.cols();
  }
  TriangleMesh joined;
  joined.positions.resize(3, num_vertices);
  joined.triangles.resize(3, num_triangles);
  Eigen::Index v = 0, t = 0;
  for (const TriangleMesh* body : bodies) {
    joined.positions.middleCols(v, body->positions.cols()) = body->positions;
    joined.triangles.middleCols(t, body->triangles.cols()) =
        body->triangles.array() + static_cast<int>(v);
    v += body->positions.cols();
    t += body->triangles.cols();
  }
  return joined;
}

cv::Mat Blocks(const cv::Mat& depth) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const int side = (depth.cols - 1) / kBlockPx + 1;
  cv::Mat blocks(side, side, CV_32FC2);
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      float nearest = kInfinity, farthest = 0;
      for (int y = row * kBlockPx; y <= std::min((row + 1) * kBlockPx, depth.rows - 1); ++y) {
        for (int x = column * kBlockPx; x <= std::min((column + 1) * kBlockPx, depth.cols - 1);
             ++x) {
          const float seen = depth.at<float>(y, x) == 0 ? kInfinity : depth.at<float>(y, x);
          nearest = std::min(nearest, seen);
          farthest = std::max(farthest, seen);
        }
      }
      blocks.at<cv::Vec2f>(row, column) = {nearest, farthest};
    }
  }
  return blocks;
}

cv::Mat WideBlocks(const cv::Mat& blocks) {
  cv::Mat wide(blocks.size(), CV_32FC2);
  for (int row = 0; row < wide.rows; ++row) {
    for (int column = 0; column < wide.cols; ++column) {
      auto& all = wide.at<cv::Vec2f>(row, column) = blocks.at<cv::Vec2f>(row, column);
      for (int y = std::max(row - 1, 0); y <= std::min(row + 1, wide.rows - 1); ++y) {
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, wide.cols - 1); ++x) {
          all[0] = std::min(all[0], blocks.at<cv::Vec2f>(y, x)[0]);
          all[1] = std::max(all[1], blocks.at<cv::Vec2f>(y, x)[1]);
        }
      }
    }
  }
  return wide;
}

}  // namespace

ShadowMap MakeShadowMap(const Eigen::Vector3d& lamp_in_world,
                        std::span<const TriangleMesh* const> bodies, int side_px) {
  ShadowMap map;
  const TriangleMesh mesh = Joined(bodies);
  if (mesh.triangles.cols() == 0) return map;
  const Eigen::Vector3d least = mesh.positions.rowwise().minCoeff().cast<double>();
  const Eigen::Vector3d most = mesh.positions.rowwise().maxCoeff().cast<double>();
  const Eigen::Vector3d centre = (least + most) / 2;
  const double radius = (most - least).norm() / 2;
  const Eigen::Vector3d to_centre = centre - lamp_in_world;
  if (!(to_centre.norm() > 1.05 * radius)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("a lamp {:.3g} m from the middle of bodies with a radius of {:.3g} m",
                            to_centre.norm(), radius));
  }
  const Eigen::Matrix3d rotation = CameraFromRay(to_centre).transpose();
  const Eigen::Matrix3Xf in_lamp = (rotation.cast<float>() * mesh.positions).colwise() -
                                   (rotation * lamp_in_world).cast<float>();
  // One texel more all around, so that the border of the map is lit.
  const Eigen::Array2d reach =
      (in_lamp.topRows<2>().array().abs().rowwise() / in_lamp.row(2).array())
          .rowwise()
          .maxCoeff()
          .cast<double>();
  Camera& lamp = map.lamp;
  lamp.name = "lamp";
  lamp.width = lamp.height = side_px;
  lamp.cx = lamp.cy = 0.5 * (side_px - 1);
  lamp.fx = (lamp.cx - 2) / std::max(reach.x(), 1e-6);
  lamp.fy = (lamp.cy - 2) / std::max(reach.y(), 1e-6);
  lamp.camera_from_world = {rotation, -(rotation * lamp_in_world)};
  lamp.has_extrinsics = true;
  RasterBuffers buffers;
  RasterizeMesh(lamp, in_lamp, mesh.triangles, {}, &buffers);
  map.depth = buffers.depth;
  map.blocks = Blocks(map.depth);
  map.wide_blocks = WideBlocks(map.blocks);
  return map;
}

LampView::LampView(const ShadowMap& map, const CameraFromWorld& camera_from_world)
    : depth_(&map.depth),
      blocks_(&map.blocks),
      wide_blocks_(&map.wide_blocks),
      last_(static_cast<float>(map.lamp.width - 1)) {
  const Camera& lamp = map.lamp;
  Eigen::Matrix3d pixel_from_lamp;
  pixel_from_lamp << lamp.fx, 0, lamp.cx, 0, lamp.fy, lamp.cy, 0, 0, 1;
  const CameraFromWorld& pose = lamp.camera_from_world;
  const Eigen::Matrix3d rotation = pose.rotation * camera_from_world.rotation.transpose();
  pixel_from_point_ = (pixel_from_lamp * rotation).cast<float>();
  offset_ = (pixel_from_lamp * (pose.translation - rotation * camera_from_world.translation))
                .cast<float>();
}

bool LampView::Misses(const Eigen::Matrix3f& corners) const {
  // The map's four sides are planes through the lamp.
  const Eigen::Matrix3f p = (pixel_from_point_ * corners).colwise() + offset_;
  const Eigen::Array3f x = p.row(0), y = p.row(1), limit = last_ * p.row(2);
  return (x < 0).all() || (y < 0).all() || (x >= limit).all() || (y >= limit).all();
}

bool LampView::ShadeTogether(const Lanes& u, const Lanes& v, const Lanes& depth,
                             Lanes* light) const {
  const float left = u.minCoeff(), right = u.maxCoeff();
  const float top = v.minCoeff(), bottom = v.maxCoeff();
  const bool inside = left >= 0 && top >= 0 && right < last_ && bottom < last_;
  if (!inside || right - left >= kBlockPx || bottom - top >= kBlockPx) return false;
  const auto& block = wide_blocks_->at<cv::Vec2f>(static_cast<int>(v[0]) / kBlockPx,
                                                  static_cast<int>(u[0]) / kBlockPx);
  if (block[0] >= depth.maxCoeff() - kShadowBiasM) return true;
  if (block[1] >= depth.minCoeff() - kShadowBiasM) return false;
  light->setZero();
  return true;
}

void LampView::Shade(const Points& x, Lanes* light) const {
  const auto row = [&](int i) -> Lanes {
    return pixel_from_point_(i, 0) * x[0] + pixel_from_point_(i, 1) * x[1] +
           pixel_from_point_(i, 2) * x[2] + offset_[i];
  };
  const Lanes depth = row(2);
  Lanes u = row(0), v = row(1);                           // times depth
  if (!(u.maxCoeff() >= 0 && v.maxCoeff() >= 0)) return;  // all of them beyond one side
  if (!((u - last_ * depth).minCoeff() < 0 && (v - last_ * depth).minCoeff() < 0)) return;
  u /= depth;
  v /= depth;
  if (ShadeTogether(u, v, depth, light)) return;
  const auto lit = [](float seen, float nearest) {
    return seen == 0 || seen >= nearest ? 1.0f : 0.0f;
  };
  for (int i = 0; i < kShadedTogether; ++i) {
    if (!((*light)[i] > 0 && u[i] >= 0 && v[i] >= 0 && u[i] < last_ && v[i] < last_)) continue;
    const int column = static_cast<int>(u[i]), line = static_cast<int>(v[i]);
    const float nearest = depth[i] - kShadowBiasM;
    const auto& block = blocks_->at<cv::Vec2f>(line / kBlockPx, column / kBlockPx);
    if (block[0] >= nearest) continue;
    if (block[1] < nearest) {
      (*light)[i] = 0;
      continue;
    }
    const float fx = u[i] - static_cast<float>(column), fy = v[i] - static_cast<float>(line);
    const float* above = depth_->ptr<float>(line) + column;
    const float* below = depth_->ptr<float>(line + 1) + column;
    (*light)[i] *= (1 - fy) * ((1 - fx) * lit(above[0], nearest) + fx * lit(above[1], nearest)) +
                   fy * ((1 - fx) * lit(below[0], nearest) + fx * lit(below[1], nearest));
  }
}

float ContactMap::At(float x, float z) const {
  const float u = (x - x_begin) * per_cell, v = (z - z_begin) * per_cell;
  if (!(u >= 0 && v >= 0 && u < static_cast<float>(darkness.cols - 1) &&
        v < static_cast<float>(darkness.rows - 1))) {
    return 0;
  }
  const int column = static_cast<int>(u), row = static_cast<int>(v);
  const float fx = u - static_cast<float>(column), fy = v - static_cast<float>(row);
  const float* above = darkness.ptr<float>(row) + column;
  const float* below = darkness.ptr<float>(row + 1) + column;
  return (1 - fy) * ((1 - fx) * above[0] + fx * above[1]) +
         fy * ((1 - fx) * below[0] + fx * below[1]);
}

ContactMap MakeContactMap(std::span<const TriangleMesh* const> bodies) {
  ContactMap map;
  const TriangleMesh mesh = Joined(bodies);
  if (mesh.triangles.cols() == 0) return map;
  const double margin = 0.3;
  const Eigen::Vector3d least = mesh.positions.rowwise().minCoeff().cast<double>();
  const Eigen::Vector3d most = mesh.positions.rowwise().maxCoeff().cast<double>();
  const Eigen::Vector2d size = {most.x() - least.x() + 2 * margin,
                                most.z() - least.z() + 2 * margin};
  const Eigen::Vector2i cells = (size / kCellM).cast<int>().cwiseMin(1024).array() + 1;
  // Looking straight up from below the floor: x to the right, z down the picture.
  Camera camera;
  camera.width = cells.x();
  camera.height = cells.y();
  camera.fx = camera.fy = kBelowFloorM / kCellM;
  Eigen::Matrix3d rotation;
  rotation << 1, 0, 0, 0, 0, 1, 0, 1, 0;  // a mirror image, which the rasteriser does not mind
  const Eigen::Vector3d eye(least.x() - margin, -kBelowFloorM, least.z() - margin);
  const Eigen::Matrix3Xf seen =
      (rotation.cast<float>() * mesh.positions).colwise() - (rotation * eye).cast<float>();
  RasterBuffers buffers;
  RasterizeMesh(camera, seen, mesh.triangles, {}, &buffers);
  map.darkness = cv::Mat::zeros(cells.y(), cells.x(), CV_32F);
  for (int row = 0; row < cells.y(); ++row) {
    for (int column = 0; column < cells.x(); ++column) {
      const float depth = buffers.depth.at<float>(row, column);
      if (depth == 0) continue;
      const double height = std::max(0.0, depth - kBelowFloorM);
      map.darkness.at<float>(row, column) =
          kContactStrength * static_cast<float>(std::exp(-height / kContactReachM));
    }
  }
  cv::GaussianBlur(map.darkness, map.darkness, {0, 0}, kContactBlurM / kCellM, 0,
                   cv::BORDER_REPLICATE);
  map.x_begin = static_cast<float>(eye.x());
  map.z_begin = static_cast<float>(eye.z());
  map.per_cell = static_cast<float>(1 / kCellM);
  return map;
}

}  // namespace mpc
