#include "mpc/render/raster.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr int kSubpixelBits = 8;
constexpr int64_t kSubpixels = 1 << kSubpixelBits;
constexpr int kMaxSide = 16384;
// Pixel coordinates are kept below this, so that edge functions fit into 64 bits with room.
constexpr double kGuardPx = 1 << 20;

struct ScreenVertex {
  int64_t x = 0;  // in 1/256 px
  int64_t y = 0;
  double inverse_z = 0;
  double b0 = 0;  // weights of the original triangle's vertices 0 and 1
  double b1 = 0;
};

// A point of a triangle that is being clipped.
struct ClipVertex {
  Eigen::Vector3d x;
  double b0;
  double b1;
};

// False when the vertex cannot be drawn as it is.
bool ToScreen(const Camera& camera, const Eigen::Vector3d& x, ScreenVertex* vertex) {
  Eigen::Vector2d pixel;
  if (!Project(camera, x, &pixel) || !(pixel.cwiseAbs().maxCoeff() < kGuardPx)) return false;
  vertex->x = std::llround(pixel.x() * kSubpixels);
  vertex->y = std::llround(pixel.y() * kSubpixels);
  vertex->inverse_z = 1 / x.z();
  return true;
}

// (b - a) x (p - a): positive when p lies on the inner side of the edge a -> b.
struct Edge {
  Edge(const ScreenVertex& a, const ScreenVertex& b, int64_t x, int64_t y)
      : step_x(-(b.y - a.y) * kSubpixels),
        step_y((b.x - a.x) * kSubpixels),
        value((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)) {
    // Top edges run right, left edges run up (y points down): they own the pixels on them.
    const bool top_left = a.y == b.y ? b.x > a.x : b.y < a.y;
    least = top_left ? 0 : 1;
  }
  int64_t step_x;
  int64_t step_y;
  int64_t value;
  int64_t least;  // smallest value that counts as inside
};

// floor and ceil of x / 256 for either sign.
int64_t FloorPixel(int64_t x) { return x >> kSubpixelBits; }
int64_t CeilPixel(int64_t x) { return (x + kSubpixels - 1) >> kSubpixelBits; }

void FillTriangle(const std::array<ScreenVertex, 3>& v, int id, RasterBuffers* buffers) {
  int64_t area = (v[1].x - v[0].x) * (v[2].y - v[0].y) - (v[1].y - v[0].y) * (v[2].x - v[0].x);
  if (area == 0) return;
  const ScreenVertex& a = v[0];
  const ScreenVertex& b = area > 0 ? v[1] : v[2];
  const ScreenVertex& c = area > 0 ? v[2] : v[1];
  area = std::abs(area);

  const int64_t x_begin = std::max<int64_t>(0, CeilPixel(std::min({a.x, b.x, c.x})));
  const int64_t y_begin = std::max<int64_t>(0, CeilPixel(std::min({a.y, b.y, c.y})));
  const int64_t x_end =
      std::min<int64_t>(buffers->depth.cols - 1, FloorPixel(std::max({a.x, b.x, c.x})));
  const int64_t y_end =
      std::min<int64_t>(buffers->depth.rows - 1, FloorPixel(std::max({a.y, b.y, c.y})));
  if (x_begin > x_end || y_begin > y_end) return;

  Edge bc(b, c, x_begin * kSubpixels, y_begin * kSubpixels);
  Edge ca(c, a, x_begin * kSubpixels, y_begin * kSubpixels);
  Edge ab(a, b, x_begin * kSubpixels, y_begin * kSubpixels);
  const double inverse_area = 1 / static_cast<double>(area);
  const bool barycentric = !buffers->barycentric.empty();
  for (int64_t y = y_begin; y <= y_end; ++y) {
    float* depth = buffers->depth.ptr<float>(static_cast<int>(y));
    int* ids = buffers->triangle_id.ptr<int>(static_cast<int>(y));
    int64_t value_bc = bc.value;
    int64_t value_ca = ca.value;
    int64_t value_ab = ab.value;
    for (int64_t x = x_begin; x <= x_end; ++x) {
      if (value_bc >= bc.least && value_ca >= ca.least && value_ab >= ab.least) {
        const double weight_b = static_cast<double>(value_ca) * inverse_area;
        const double weight_c = static_cast<double>(value_ab) * inverse_area;
        const double inverse_z = a.inverse_z + weight_b * (b.inverse_z - a.inverse_z) +
                                 weight_c * (c.inverse_z - a.inverse_z);
        const float z = static_cast<float>(1 / inverse_z);
        if (ids[x] < 0 || z < depth[x]) {
          depth[x] = z;
          ids[x] = id;
          if (barycentric) {
            const double wa = (1 - weight_b - weight_c) * a.inverse_z / inverse_z;
            const double wb = weight_b * b.inverse_z / inverse_z;
            const double wc = weight_c * c.inverse_z / inverse_z;
            buffers->barycentric.ptr<cv::Vec2f>(static_cast<int>(y))[x] = {
                static_cast<float>(wa * a.b0 + wb * b.b0 + wc * c.b0),
                static_cast<float>(wa * a.b1 + wb * b.b1 + wc * c.b1)};
          }
        }
      }
      value_bc += bc.step_x;
      value_ca += ca.step_x;
      value_ab += ab.step_x;
    }
    bc.value += bc.step_y;
    ca.value += ca.step_y;
    ab.value += ab.step_y;
  }
}

// Keeps the part of a convex polygon where normal . x >= offset. A crossing is always computed from
// the inner to the outer end, so that two triangles with a common edge get the same point.
void ClipAgainst(const Eigen::Vector3d& normal, double offset, std::vector<ClipVertex>* polygon) {
  std::vector<ClipVertex> kept;
  for (size_t i = 0; i < polygon->size(); ++i) {
    const ClipVertex& from = (*polygon)[i];
    const ClipVertex& to = (*polygon)[(i + 1) % polygon->size()];
    const double from_distance = normal.dot(from.x) - offset;
    const double to_distance = normal.dot(to.x) - offset;
    if (from_distance >= 0) kept.push_back(from);
    if ((from_distance >= 0) == (to_distance >= 0)) continue;
    const bool leaving = from_distance >= 0;
    const ClipVertex& in = leaving ? from : to;
    const ClipVertex& out = leaving ? to : from;
    const double in_distance = leaving ? from_distance : to_distance;
    const double out_distance = leaving ? to_distance : from_distance;
    const double t = in_distance / (in_distance - out_distance);
    kept.push_back(
        {in.x + t * (out.x - in.x), in.b0 + t * (out.b0 - in.b0), in.b1 + t * (out.b1 - in.b1)});
  }
  polygon->swap(kept);
}

// A triangle that reaches behind the near plane or far outside the picture.
void FillClipped(const Camera& camera, const std::array<Eigen::Vector3d, 3>& corners, double near_m,
                 int id, RasterBuffers* buffers) {
  std::vector<ClipVertex> polygon = {{corners[0], 1, 0}, {corners[1], 0, 1}, {corners[2], 0, 0}};
  ClipAgainst(Eigen::Vector3d::UnitZ(), near_m, &polygon);
  // The tangent of the widest angle whose pixels stay inside the guard band.
  const double reach_x = (0.5 * kGuardPx - std::abs(camera.cx)) / camera.fx;
  const double reach_y = (0.5 * kGuardPx - std::abs(camera.cy)) / camera.fy;
  ClipAgainst({1, 0, reach_x}, 0, &polygon);
  ClipAgainst({-1, 0, reach_x}, 0, &polygon);
  ClipAgainst({0, 1, reach_y}, 0, &polygon);
  ClipAgainst({0, -1, reach_y}, 0, &polygon);
  std::vector<ScreenVertex> screen;
  for (const ClipVertex& vertex : polygon) {
    ScreenVertex on_screen;
    if (!ToScreen(camera, vertex.x, &on_screen)) return;
    on_screen.b0 = vertex.b0;
    on_screen.b1 = vertex.b1;
    screen.push_back(on_screen);
  }
  for (size_t i = 2; i < screen.size(); ++i) {
    FillTriangle({screen[0], screen[i - 1], screen[i]}, id, buffers);
  }
}

void ClearBuffers(const Camera& camera, const RasterOptions& options, RasterBuffers* buffers) {
  buffers->depth.create(camera.height, camera.width, CV_32F);
  buffers->triangle_id.create(camera.height, camera.width, CV_32S);
  buffers->depth.setTo(0);
  buffers->triangle_id.setTo(-1);
  if (options.barycentric) {
    buffers->barycentric.create(camera.height, camera.width, CV_32FC2);
  } else {
    buffers->barycentric.release();
  }
}

void CheckArguments(const Camera& camera, const Triangles& triangles, Eigen::Index num_vertices) {
  camera.Validate();
  if (camera.width > kMaxSide || camera.height > kMaxSide) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("a picture of {} x {} is larger than {} on a side", camera.width,
                            camera.height, kMaxSide));
  }
  if (triangles.size() > 0 && (triangles.minCoeff() < 0 || triangles.maxCoeff() >= num_vertices)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("triangles use vertices {} to {} of a mesh that has {}",
                            triangles.minCoeff(), triangles.maxCoeff(), num_vertices));
  }
}

}  // namespace

void RasterizeMesh(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                   const Triangles& triangles, const RasterOptions& options,
                   RasterBuffers* buffers) {
  CheckArguments(camera, triangles, positions_in_camera.cols());
  ClearBuffers(camera, options, buffers);

  enum class State : uint8_t { kVisible, kNeedsClipping, kUnusable };
  const Eigen::Index num_vertices = positions_in_camera.cols();
  std::vector<ScreenVertex> screen(static_cast<size_t>(num_vertices));
  std::vector<State> state(static_cast<size_t>(num_vertices), State::kUnusable);
  for (Eigen::Index i = 0; i < num_vertices; ++i) {
    const Eigen::Vector3d x = positions_in_camera.col(i).cast<double>();
    if (!x.allFinite()) continue;
    const bool in_front = x.z() >= options.near_m;
    const bool visible = in_front && ToScreen(camera, x, &screen[i]);
    state[i] = visible ? State::kVisible : State::kNeedsClipping;
  }
  for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
    const Eigen::Vector3i corner = triangles.col(t);
    std::array<ScreenVertex, 3> vertices;
    std::array<Eigen::Vector3d, 3> positions;
    bool clip = false;
    bool usable = true;
    for (int i = 0; i < 3; ++i) {
      clip |= state[corner[i]] == State::kNeedsClipping;
      usable &= state[corner[i]] != State::kUnusable;
    }
    if (!usable) continue;
    for (int i = 0; i < 3; ++i) {
      vertices[i] = screen[corner[i]];
      positions[i] = positions_in_camera.col(corner[i]).cast<double>();
    }
    if (clip) {
      FillClipped(camera, positions, options.near_m, static_cast<int>(t), buffers);
      continue;
    }
    vertices[0].b0 = 1;
    vertices[1].b1 = 1;
    FillTriangle(vertices, static_cast<int>(t), buffers);
  }
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
