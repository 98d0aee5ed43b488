#include "mpc/render/boundary.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/render/raster.h"
#include "outline.h"
#include "raster_kernel.h"

namespace mpc {
namespace {

// Radius of a limb or trunk, m: how fast a visible surface recedes towards its rim.
constexpr double kSurfaceRadius_m = 0.15;
// How far from a vertex the mask tells inside from outside.
constexpr double kProbe_px = 2;
// Around the model, so that the border of the crop is never taken for the picture's.
constexpr int kCropMargin_px = 4;
constexpr int kTile_px = 4;
const double kNear_m = RasterOptions().near_m;

cv::Point Nearest(const Eigen::Vector2d& pixel) { return {cvRound(pixel.x()), cvRound(pixel.y())}; }

// Both kinds of pixel among the 3 x 3 around a point; nothing outside the picture counts.
bool OnBorder(const cv::Mat& mask, const cv::Point& point) {
  const cv::Rect around = cv::Rect(point.x - 1, point.y - 1, 3, 3) & cv::Rect({}, mask.size());
  int inside = 0;
  for (int y = around.y; y < around.br().y; ++y) {
    for (int x = around.x; x < around.br().x; ++x) inside += mask.at<uchar>(y, x) != 0;
  }
  return inside > 0 && inside < around.area();
}

// A rim lies behind the pixels next to it, by as much as a round limb recedes within their reach.
bool IsHidden(const Camera& camera, const cv::Mat& depth, const cv::Point& point, double z) {
  const cv::Rect around = cv::Rect(point.x - 1, point.y - 1, 3, 3) & cv::Rect({}, depth.size());
  float farthest = 0;
  for (int y = around.y; y < around.br().y; ++y) {
    for (int x = around.x; x < around.br().x; ++x) {
      farthest = std::max(farthest, depth.at<float>(y, x));
    }
  }
  const double reach = 1.5 * z / std::min(camera.fx, camera.fy);
  return z > farthest + std::sqrt(2 * kSurfaceRadius_m * reach) + reach;
}

bool IsSet(const cv::Mat& mask, const Eigen::Vector2d& pixel) {
  const cv::Point point = Nearest(pixel);
  return cv::Rect({}, mask.size()).contains(point) && mask.at<uchar>(point) != 0;
}

void CheckImage(const Camera& camera, const cv::Mat& image, int type, const char* name) {
  if (image.type() == type && image.cols == camera.width && image.rows == camera.height) return;
  throw Error(
      ErrorCode::kInvalidArgument,
      fmt::format("{} of {} x {} for a camera of {} x {} ({} expected)", name, image.cols,
                  image.rows, camera.width, camera.height, type == CV_8UC1 ? "CV_8UC1" : "CV_32F"));
}

// Unit, or zero where there is no surface.
Eigen::Vector3d SurfaceNormal(const Eigen::Matrix3Xf& positions, const SurfaceTopology& topology,
                              int v) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  const auto vertex = static_cast<size_t>(v);
  for (int i = topology.vertex_begin[vertex]; i < topology.vertex_begin[vertex + 1]; ++i) {
    const Eigen::Vector3i corner =
        topology.triangles.col(topology.vertex_triangles[static_cast<size_t>(i)]);
    const Eigen::Vector3f a = positions.col(corner[0]);
    const Eigen::Vector3f area = (positions.col(corner[1]) - a).cross(positions.col(corner[2]) - a);
    if (area.allFinite()) sum += area;
  }
  return sum.stableNormalized().cast<double>();
}

cv::Point NearestPixel(const ScreenVertex& v) {
  return {FloorPixel(v.x + kSubpixels / 2), FloorPixel(v.y + kSubpixels / 2)};
}

// What an outline's edges say of its vertices.
struct RimVertices {
  std::vector<int> vertices;  // on an outline and on the mask's border, increasing
  Eigen::Matrix2Xf across;    // 2xV: the direction out of the surface across open edges
};

RimVertices FindRim(const Outline& outline, const SurfaceTopology& topology, const cv::Mat& mask) {
  const size_t num_vertices = outline.vertices.size();
  std::vector<uint8_t> on_outline(num_vertices);
  RimVertices rim;
  rim.across.setZero(2, static_cast<Eigen::Index>(num_vertices));
  for (const SurfaceTopology::Edge& edge : topology.edges) {
    const int weight = outline.Weight(edge);
    if (weight == 0) continue;
    on_outline[static_cast<size_t>(edge.v0)] = 1;
    on_outline[static_cast<size_t>(edge.v1)] = 1;
    if (edge.side1 >= 0) continue;
    const ScreenVertex& from = outline.vertices[static_cast<size_t>(edge.v0)];
    const ScreenVertex& to = outline.vertices[static_cast<size_t>(edge.v1)];
    const Eigen::Vector2f out = Eigen::Vector2i(to.y - from.y, from.x - to.x).cast<float>();
    rim.across.col(edge.v0) += static_cast<float>(weight) * out;
    rim.across.col(edge.v1) += static_cast<float>(weight) * out;
  }
  for (size_t v = 0; v < num_vertices; ++v) {
    if (on_outline[v] == 0) continue;
    const cv::Point nearest = NearestPixel(outline.vertices[v]);
    if (cv::Rect({}, mask.size()).contains(nearest) && OnBorder(mask, nearest)) {
      rim.vertices.push_back(static_cast<int>(v));
    }
  }
  return rim;
}

ModelBoundary BoundaryOfRim(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                            const SurfaceTopology& topology, const Outline& outline,
                            const RimVertices& rim, const cv::Mat& mask, const cv::Mat& depth,
                            const BoundaryOptions& options) {
  ModelBoundary boundary;
  std::vector<Eigen::Vector2d> pixels, normals;
  for (const int v : rim.vertices) {
    const Eigen::Vector3d x = positions_in_camera.col(v).cast<double>();
    const cv::Point nearest = NearestPixel(outline.vertices[static_cast<size_t>(v)]);
    if (!depth.empty() && IsHidden(camera, depth, nearest, x.z())) continue;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> jacobian;
    if (!Project(camera, x, &pixel, &jacobian)) continue;

    Eigen::Vector2d normal = rim.across.col(v).cast<double>();
    if (normal.isZero()) {
      const Eigen::Vector3d in_space = SurfaceNormal(positions_in_camera, topology, v);
      if (in_space.cross(x.normalized()).norm() < options.min_projected_normal) continue;
      // The plane through the camera that touches the surface, as a line in the picture.
      normal = (jacobian * jacobian.transpose()).inverse() * jacobian * in_space;
    }
    normal.normalize();
    if (!normal.allFinite()) continue;
    // Seen from inside, as through the opening of a sleeve, the surface's own normal points inwards.
    // A fold inside the mask that only ends at its border, as between two toes, points nowhere.
    const Eigen::Vector2d probe = kProbe_px * normal;
    if (IsSet(mask, pixel + probe)) {
      if (IsSet(mask, pixel - probe)) continue;
      normal = -normal;
    }
    boundary.vertices.push_back(v);
    pixels.push_back(pixel);
    normals.push_back(normal);
  }
  const auto count = static_cast<Eigen::Index>(pixels.size());
  boundary.pixels.resize(2, count);
  boundary.normals.resize(2, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    boundary.pixels.col(i) = pixels[static_cast<size_t>(i)];
    boundary.normals.col(i) = normals[static_cast<size_t>(i)];
  }
  return boundary;
}

// The depth image of RasterizeMesh in the tiles around some vertices; elsewhere it means nothing.
void DrawDepthAt(const Outline& outline, const SurfaceTopology& topology,
                 const std::vector<int>& vertices, const cv::Size& size, RasterBuffers* buffers) {
  const cv::Rect tiles(0, 0, size.width / kTile_px + 1, size.height / kTile_px + 1);
  std::vector<uint8_t> wanted(static_cast<size_t>(tiles.area()));
  const auto for_tiles = [&](int x0, int y0, int x1, int y1, const auto& visit) {
    const cv::Rect touched = cv::Rect(cv::Point(x0 / kTile_px, y0 / kTile_px),
                                      cv::Point(x1 / kTile_px + 1, y1 / kTile_px + 1)) &
                             tiles;
    for (int y = touched.y; y < touched.br().y; ++y) {
      for (int x = touched.x; x < touched.br().x; ++x) {
        const int tile = y * tiles.width + x;
        if (!visit(wanted[static_cast<size_t>(tile)])) return;
      }
    }
  };
  for (const int v : vertices) {
    const cv::Point p = NearestPixel(outline.vertices[static_cast<size_t>(v)]);
    for_tiles(std::max(0, p.x - 1), std::max(0, p.y - 1), p.x + 1, p.y + 1, [](uint8_t& tile) {
      tile = 1;
      return true;
    });
  }
  std::vector<int> corners;
  for (int t = 0; t < topology.triangles.cols(); ++t) {
    const ScreenVertex& a = outline.vertices[static_cast<size_t>(topology.triangles(0, t))];
    const ScreenVertex& b = outline.vertices[static_cast<size_t>(topology.triangles(1, t))];
    const ScreenVertex& c = outline.vertices[static_cast<size_t>(topology.triangles(2, t))];
    const int x1 = FloorPixel(std::max({a.x, b.x, c.x}));
    const int y1 = FloorPixel(std::max({a.y, b.y, c.y}));
    if (x1 < 0 || y1 < 0) continue;
    bool seen = false;
    for_tiles(std::max(0, FloorPixel(std::min({a.x, b.x, c.x}))),
              std::max(0, FloorPixel(std::min({a.y, b.y, c.y}))), x1, y1,
              [&](const uint8_t& tile) { return !(seen |= tile != 0); });
    if (seen)
      corners.insert(corners.end(), {topology.triangles(0, t), topology.triangles(1, t),
                                     topology.triangles(2, t)});
  }

  buffers->depth.create(size, CV_32F);
  buffers->triangle_id.create(size, CV_32S);
  cv::Mat& depth = buffers->depth;
  const auto for_wanted = [&](const auto& visit) {
    for (size_t tile = 0; tile < wanted.size(); ++tile) {
      if (wanted[tile] == 0) continue;
      const int i = static_cast<int>(tile);
      const cv::Point corner(i % tiles.width * kTile_px, i / tiles.width * kTile_px);
      const cv::Rect area = cv::Rect(corner, cv::Size(kTile_px, kTile_px)) & cv::Rect({}, size);
      for (int y = area.y; y < area.br().y; ++y) visit(depth.ptr<float>(y) + area.x, area.width);
    }
  };
  for_wanted([](float* values, int count) { std::fill_n(values, count, 0.F); });
  BestTriangleKernel()(
      outline.vertices.data(), corners.data(), static_cast<int>(corners.size() / 3), 0,
      {depth.ptr<float>(), buffers->triangle_id.ptr<int>(),
       static_cast<std::ptrdiff_t>(depth.step1()),
       static_cast<std::ptrdiff_t>(buffers->triangle_id.step1()), size.width, size.height});
  for_wanted(InvertSeen);
}

}  // namespace

ModelBoundary FindModelBoundary(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                                const SurfaceTopology& topology, const cv::Mat& mask,
                                const cv::Mat& depth, const BoundaryOptions& options) {
  CheckImage(camera, mask, CV_8UC1, "a mask");
  if (!depth.empty()) CheckImage(camera, depth, CV_32F, "a depth image");
  const Outline outline = ComputeOutline(camera, positions_in_camera, topology, kNear_m);
  return BoundaryOfRim(camera, positions_in_camera, topology, outline,
                       FindRim(outline, topology, mask), mask, depth, options);
}

ModelBoundary DrawModelBoundary(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                                const SurfaceTopology& topology, bool drop_hidden,
                                BoundaryBuffers* buffers, const BoundaryOptions& options) {
  Outline outline = ComputeOutline(camera, positions_in_camera, topology, kNear_m);
  cv::Rect crop = ScreenBounds(camera, outline.vertices);
  if (crop.empty()) return {};
  crop -= cv::Point(kCropMargin_px, kCropMargin_px);
  crop += cv::Size(2 * kCropMargin_px, 2 * kCropMargin_px);
  crop &= cv::Rect(0, 0, camera.width, camera.height);
  const Camera cropped = CroppedTo(camera, crop);
  for (ScreenVertex& v : outline.vertices) {
    v.x -= crop.x * kSubpixels;
    v.y -= crop.y * kSubpixels;
  }
  DrawOutlineMask(cropped, positions_in_camera, topology, outline, &buffers->mask);
  const RimVertices rim = FindRim(outline, topology, buffers->mask);
  cv::Mat depth;
  if (drop_hidden) {
    if (outline.clipped.empty()) {
      DrawDepthAt(outline, topology, rim.vertices, buffers->mask.size(), &buffers->raster);
    } else {
      RasterizeMesh(cropped, positions_in_camera, topology.triangles, {}, &buffers->raster);
    }
    depth = buffers->raster.depth;
  }
  ModelBoundary boundary = BoundaryOfRim(cropped, positions_in_camera, topology, outline, rim,
                                         buffers->mask, depth, options);
  boundary.pixels.colwise() += Eigen::Vector2d(crop.x, crop.y);
  return boundary;
}

}  // namespace mpc
