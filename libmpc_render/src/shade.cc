#include "mpc/render/shade.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/render/raster.h"

namespace mpc {
namespace {

void CheckSizes(const Camera& camera, Eigen::Index num_vertices, Eigen::Index num_triangles,
                const MeshAppearance& appearance, double alpha, const cv::Mat& image) {
  const auto fail = [](const std::string& text) { throw Error(ErrorCode::kInvalidArgument, text); };
  if (image.type() != CV_8UC3 || image.cols != camera.width || image.rows != camera.height) {
    fail(fmt::format("an image of {} x {} for a camera of {} x {} (8-bit BGR expected)", image.cols,
                     image.rows, camera.width, camera.height));
  }
  if (!(alpha >= 0 && alpha <= 1)) fail(fmt::format("opacity {} is not in [0, 1]", alpha));
  const auto check = [&](const char* name, Eigen::Index found, Eigen::Index expected) {
    if (found != 0 && found != expected) {
      fail(fmt::format("{} {} for {} expected", found, name, expected));
    }
  };
  check("texture coordinates", appearance.uv.cols(), num_vertices);
  check("vertex colours", appearance.vertex_bgr.cols(), num_vertices);
  check("triangle colours", appearance.triangle_bgr.cols(), num_triangles);
  for (const cv::Mat& texture : appearance.textures) {
    if (texture.empty()) continue;
    if (texture.type() != CV_8UC3 || appearance.uv.cols() != num_vertices) {
      fail("a texture must be 8-bit BGR and needs coordinates for every vertex");
    }
  }
  const std::vector<int>& chosen = appearance.triangle_texture;
  check("textures of triangles", static_cast<Eigen::Index>(chosen.size()), num_triangles);
  const int num_textures = static_cast<int>(appearance.textures.size());
  if (std::any_of(chosen.begin(), chosen.end(),
                  [&](int texture) { return texture < 0 || texture >= num_textures; })) {
    fail(fmt::format("a triangle has none of the {} textures", num_textures));
  }
  if (!appearance.uv.allFinite()) fail("a texture coordinate is not finite");
}

// Bilinear, repeating beyond [0, 1].
Eigen::Vector3f SampleTexture(const cv::Mat& texture, const Eigen::Vector2f& uv) {
  const auto wrap = [](int i, int n) { return i < 0 ? i + n : (i >= n ? i - n : i); };
  const float x = (uv.x() - std::floor(uv.x())) * static_cast<float>(texture.cols) - 0.5f;
  const float y = (uv.y() - std::floor(uv.y())) * static_cast<float>(texture.rows) - 0.5f;
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const auto at = [&](int row, int column) -> Eigen::Vector3f {
    const cv::Vec3b& bgr =
        texture.at<cv::Vec3b>(wrap(row, texture.rows), wrap(column, texture.cols));
    return {static_cast<float>(bgr[0]), static_cast<float>(bgr[1]), static_cast<float>(bgr[2])};
  };
  return (1 - fy) * ((1 - fx) * at(y0, x0) + fx * at(y0, x0 + 1)) +
         fy * ((1 - fx) * at(y0 + 1, x0) + fx * at(y0 + 1, x0 + 1));
}

}  // namespace

void ShadeMesh(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
               const Triangles& triangles, const MeshAppearance& appearance, double alpha,
               cv::Mat* image) {
  CheckSizes(camera, positions_in_camera.cols(), triangles.cols(), appearance, alpha, *image);
  const cv::Rect bounds = ProjectedBounds(camera, positions_in_camera);
  if (bounds.empty()) return;
  RasterOptions options;
  options.barycentric = true;
  RasterBuffers buffers;
  RasterizeMesh(CroppedTo(camera, bounds), positions_in_camera, triangles, options, &buffers);

  // Light per vertex: |cosine| between normal and view, so that either side is lit.
  Eigen::Matrix3Xf normals;
  VertexNormals(positions_in_camera, triangles, &normals);
  const auto ambient = static_cast<float>(appearance.ambient);
  Eigen::VectorXf light(positions_in_camera.cols());
  for (Eigen::Index v = 0; v < light.size(); ++v) {
    const Eigen::Vector3f view = positions_in_camera.col(v).normalized();
    const float cosine = std::abs(view.dot(normals.col(v)));
    // A non-finite neighbour leaves a vertex without a normal.
    light[v] = std::isfinite(cosine) ? ambient + (1 - ambient) * cosine : 1.0f;
  }
  const Eigen::Vector3f single(appearance.bgr[0], appearance.bgr[1], appearance.bgr[2]);
  const std::vector<cv::Mat>& textures = appearance.textures;
  const auto texture_of = [&](int triangle) -> const cv::Mat* {
    if (textures.empty()) return nullptr;
    const std::vector<int>& chosen = appearance.triangle_texture;
    const cv::Mat& texture = textures[chosen.empty() ? 0 : static_cast<size_t>(chosen[triangle])];
    return texture.empty() ? nullptr : &texture;
  };
  const bool per_vertex = appearance.vertex_bgr.cols() > 0;
  const bool per_triangle = appearance.triangle_bgr.cols() > 0;
  const auto opacity = static_cast<float>(alpha);

  for (int y = 0; y < bounds.height; ++y) {
    const int* ids = buffers.triangle_id.ptr<int>(y);
    const cv::Vec2f* weights = buffers.barycentric.ptr<cv::Vec2f>(y);
    cv::Vec3b* out = image->ptr<cv::Vec3b>(bounds.y + y) + bounds.x;
    for (int x = 0; x < bounds.width; ++x) {
      if (ids[x] < 0) continue;
      const Eigen::Vector3i corner = triangles.col(ids[x]);
      const Eigen::Vector3f w(weights[x][0], weights[x][1], 1 - weights[x][0] - weights[x][1]);
      Eigen::Vector3f bgr = single;
      if (const cv::Mat* const texture = texture_of(ids[x])) {
        bgr = SampleTexture(*texture, appearance.uv.col(corner[0]) * w[0] +
                                          appearance.uv.col(corner[1]) * w[1] +
                                          appearance.uv.col(corner[2]) * w[2]);
      } else if (per_vertex) {
        bgr = appearance.vertex_bgr.col(corner[0]) * w[0] +
              appearance.vertex_bgr.col(corner[1]) * w[1] +
              appearance.vertex_bgr.col(corner[2]) * w[2];
      } else if (per_triangle) {
        bgr = appearance.triangle_bgr.col(ids[x]);
      }
      bgr *= light[corner[0]] * w[0] + light[corner[1]] * w[1] + light[corner[2]] * w[2];
      for (int channel = 0; channel < 3; ++channel) {
        const float below = static_cast<float>(out[x][channel]);
        out[x][channel] = cv::saturate_cast<uchar>(below + opacity * (bgr[channel] - below));
      }
    }
  }
}

}  // namespace mpc
