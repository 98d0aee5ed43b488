#include "mpc/render/boundary.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/render/raster.h"
#include "outline.h"

namespace mpc {
namespace {

// Radius of a limb or trunk, m: how fast a visible surface recedes towards its rim.
constexpr double kSurfaceRadius_m = 0.15;
// How far from a vertex the mask tells inside from outside.
constexpr double kProbe_px = 2;

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

}  // namespace

ModelBoundary FindModelBoundary(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                                const SurfaceTopology& topology, const cv::Mat& mask,
                                const cv::Mat& depth, const BoundaryOptions& options) {
  CheckImage(camera, mask, CV_8UC1, "a mask");
  if (!depth.empty()) CheckImage(camera, depth, CV_32F, "a depth image");
  const Outline outline =
      ComputeOutline(camera, positions_in_camera, topology, RasterOptions().near_m);

  // Per vertex: whether it lies on an outline, and the direction out of the surface across its open
  // edges.
  std::vector<uint8_t> on_outline(outline.vertices.size());
  Eigen::Matrix2Xf across = Eigen::Matrix2Xf::Zero(2, positions_in_camera.cols());
  for (const SurfaceTopology::Edge& edge : topology.edges) {
    const int weight = outline.Weight(edge);
    if (weight == 0) continue;
    on_outline[static_cast<size_t>(edge.v0)] = 1;
    on_outline[static_cast<size_t>(edge.v1)] = 1;
    if (edge.side1 >= 0) continue;
    const ScreenVertex& from = outline.vertices[static_cast<size_t>(edge.v0)];
    const ScreenVertex& to = outline.vertices[static_cast<size_t>(edge.v1)];
    const Eigen::Vector2f out = Eigen::Vector2i(to.y - from.y, from.x - to.x).cast<float>();
    across.col(edge.v0) += static_cast<float>(weight) * out;
    across.col(edge.v1) += static_cast<float>(weight) * out;
  }

  ModelBoundary boundary;
  std::vector<Eigen::Vector2d> pixels, normals;
  for (int v = 0; v < positions_in_camera.cols(); ++v) {
    if (on_outline[static_cast<size_t>(v)] == 0) continue;
    const ScreenVertex& on_screen = outline.vertices[static_cast<size_t>(v)];
    const cv::Point nearest(FloorPixel(on_screen.x + kSubpixels / 2),
                            FloorPixel(on_screen.y + kSubpixels / 2));
    if (!cv::Rect({}, mask.size()).contains(nearest) || !OnBorder(mask, nearest)) continue;
    const Eigen::Vector3d x = positions_in_camera.col(v).cast<double>();
    if (!depth.empty() && IsHidden(camera, depth, nearest, x.z())) continue;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> jacobian;
    if (!Project(camera, x, &pixel, &jacobian)) continue;

    Eigen::Vector2d normal = across.col(v).cast<double>();
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

}  // namespace mpc
