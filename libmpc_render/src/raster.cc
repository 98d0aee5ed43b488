#include "mpc/render/raster.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "raster_kernel.h"
#include "screen.h"

namespace mpc {
namespace {

ScreenTriangle Corners(const std::vector<ScreenVertex>& vertices, const Eigen::Vector3i& corners) {
  return {vertices[static_cast<size_t>(corners[0])], vertices[static_cast<size_t>(corners[1])],
          vertices[static_cast<size_t>(corners[2])]};
}

// Weights of a triangle's corners at a pixel: three linear functions, up to a common factor.
struct Weights {
  Eigen::Matrix3d rows = Eigen::Matrix3d::Zero();
  bool of_ray = false;  // functions of the ray through the pixel, else of (x, y, 1)
};

// A triangle drawn as it is: edge functions over z.
Weights ScreenWeights(const ScreenTriangle& v) {
  Weights weights;
  for (size_t i = 0; i < 3; ++i) {
    const ScreenVertex& from = v[(i + 1) % 3];
    const ScreenVertex& to = v[(i + 2) % 3];
    const double dx = static_cast<double>(v[i].inverse_z) * (to.x - from.x);
    const double dy = static_cast<double>(v[i].inverse_z) * (to.y - from.y);
    weights.rows.row(static_cast<Eigen::Index>(i)) << -dy * kSubpixels, dx * kSubpixels,
        dy * from.x - dx * from.y;
  }
  return weights;
}

// A clipped triangle: the ray's coordinates in the basis of the three corners.
Weights RayWeights(const Eigen::Matrix3d& x_in_camera) {
  Weights weights;
  weights.of_ray = true;
  for (int i = 0; i < 3; ++i) {
    weights.rows.row(i) =
        x_in_camera.col((i + 1) % 3).cross(x_in_camera.col((i + 2) % 3)).transpose();
  }
  return weights;
}

void FillBarycentric(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                     const Triangles& triangles, const std::vector<ScreenVertex>& vertices,
                     const cv::Rect& bounds, RasterBuffers* buffers) {
  int known = -1;
  Weights weights;
  for (int y = bounds.y; y < bounds.y + bounds.height; ++y) {
    const int* ids = buffers->triangle_id.ptr<int>(y);
    cv::Vec2f* out = buffers->barycentric.ptr<cv::Vec2f>(y);
    for (int x = bounds.x; x < bounds.x + bounds.width; ++x) {
      if (ids[x] < 0) continue;
      if (ids[x] != known) {
        known = ids[x];
        const Eigen::Vector3i corners = triangles.col(known);
        const ScreenTriangle on_screen = Corners(vertices, corners);
        weights = TriangleState(on_screen) == VertexState::kVisible
                      ? ScreenWeights(on_screen)
                      : RayWeights(positions_in_camera(Eigen::all, corners).cast<double>());
      }
      Eigen::Vector3d at(x, y, 1);
      if (weights.of_ray) at.head<2>() = Undistort(camera, at.head<2>());
      const Eigen::Vector3d scaled = weights.rows * at;
      const double sum = scaled.sum();
      // Snapping and straight edges under distortion add pixels beyond the triangle: its rim.
      const double scale = sum != 0 ? 1 / sum : 0;
      const double b0 = std::clamp(scaled[0] * scale, 0.0, 1.0);
      const double b1 = std::clamp(scaled[1] * scale, 0.0, 1 - b0);
      out[x] = {static_cast<float>(b0), static_cast<float>(b1)};
    }
  }
}

void Rasterize(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
               const Triangles& triangles, const RasterOptions& options, TriangleKernel fill,
               RasterBuffers* buffers) {
  CheckArguments(camera, triangles, positions_in_camera.cols());
  cv::Mat& depth = buffers->depth;
  cv::Mat& ids = buffers->triangle_id;
  depth.create(camera.height, camera.width, CV_32F);
  ids.create(camera.height, camera.width, CV_32S);
  depth.setTo(0);
  ids.setTo(-1);
  if (options.barycentric) {
    buffers->barycentric.create(camera.height, camera.width, CV_32FC2);
  } else {
    buffers->barycentric.release();
  }

  const std::vector<ScreenVertex> vertices =
      ProjectVertices(camera, positions_in_camera, options.near_m);
  const cv::Rect bounds = ScreenBounds(camera, vertices);
  if (bounds.empty()) return;
  const RasterTarget target = {depth.ptr<float>(),
                               ids.ptr<int>(),
                               static_cast<std::ptrdiff_t>(depth.step1()),
                               static_cast<std::ptrdiff_t>(ids.step1()),
                               camera.width,
                               camera.height};
  const bool clipping = std::any_of(vertices.begin(), vertices.end(), [](const ScreenVertex& v) {
    return v.state == VertexState::kNeedsClipping;
  });
  if (!clipping) {
    fill(vertices.data(), triangles.data(), static_cast<int>(triangles.cols()), 0, target);
  } else {
    // In order: of equally near triangles the first is seen.
    for (int t = 0; t < triangles.cols(); ++t) {
      const int* corners = triangles.col(t).data();
      fill(vertices.data(), corners, 1, t, target);
      if (TriangleState(Corners(vertices, triangles.col(t))) != VertexState::kNeedsClipping)
        continue;
      const std::vector<ScreenVertex> polygon =
          ClippedTriangle(camera, positions_in_camera, triangles.col(t), options.near_m);
      for (int i = 2; i < static_cast<int>(polygon.size()); ++i) {
        const int fan[3] = {0, i - 1, i};
        fill(polygon.data(), fan, 1, t, target);
      }
    }
  }

  // The kernels compare 1 / z, which needs no division per pixel and triangle.
  for (int y = bounds.y; y < bounds.y + bounds.height; ++y) {
    InvertSeen(depth.ptr<float>(y) + bounds.x, bounds.width);
  }
  if (options.barycentric) {
    FillBarycentric(camera, positions_in_camera, triangles, vertices, bounds, buffers);
  }
}

}  // namespace

void InvertSeen(float* values, int count) {
  // Without branches, so that it vectorises.
  for (int i = 0; i < count; ++i) {
    const uint32_t seen = std::bit_cast<uint32_t>(values[i]) != 0 ? ~0u : 0u;
    values[i] = std::bit_cast<float>(std::bit_cast<uint32_t>(1 / values[i]) & seen);
  }
}

void RasterizeMesh(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                   const Triangles& triangles, const RasterOptions& options,
                   RasterBuffers* buffers) {
  Rasterize(camera, positions_in_camera, triangles, options, BestTriangleKernel(), buffers);
}

void RasterizeMeshScalar(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                         const Triangles& triangles, const RasterOptions& options,
                         RasterBuffers* buffers) {
  Rasterize(camera, positions_in_camera, triangles, options, FillTrianglesScalar, buffers);
}

cv::Rect ProjectedBounds(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                         double near_m) {
  const cv::Rect picture(0, 0, camera.width, camera.height);
  if (positions_in_camera.cols() == 0) return {};
  Eigen::Vector2d least = Eigen::Vector2d::Constant(kGuardPx);
  Eigen::Vector2d most = Eigen::Vector2d::Constant(-kGuardPx);
  for (Eigen::Index i = 0; i < positions_in_camera.cols(); ++i) {
    const Eigen::Vector3d x = positions_in_camera.col(i).cast<double>();
    if (!x.allFinite()) continue;
    Eigen::Vector2d pixel;
    if (x.z() < near_m || !Project(camera, x, &pixel)) return picture;
    least = least.cwiseMin(pixel.cwiseMax(-kGuardPx));
    most = most.cwiseMax(pixel.cwiseMin(kGuardPx));
  }
  const cv::Point begin(static_cast<int>(std::floor(least.x())),
                        static_cast<int>(std::floor(least.y())));
  const cv::Point end(static_cast<int>(std::ceil(most.x())) + 1,
                      static_cast<int>(std::ceil(most.y())) + 1);
  if (begin.x >= end.x || begin.y >= end.y) return {};
  return cv::Rect(begin, end) & picture;
}

Camera CroppedTo(const Camera& camera, const cv::Rect& rect) {
  Camera cropped = camera;
  cropped.width = rect.width;
  cropped.height = rect.height;
  cropped.cx -= rect.x;
  cropped.cy -= rect.y;
  return cropped;
}

cv::Mat MeshMask(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                 const Triangles& triangles) {
  CheckArguments(camera, triangles, positions_in_camera.cols());
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  const cv::Rect bounds = ProjectedBounds(camera, positions_in_camera);
  if (bounds.empty()) return mask;
  RasterBuffers buffers;
  RasterizeMesh(CroppedTo(camera, bounds), positions_in_camera, triangles, {}, &buffers);
  cv::Mat(buffers.triangle_id >= 0).copyTo(mask(bounds));
  return mask;
}

}  // namespace mpc
