#include "mpc/render/lit_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/render/raster.h"
#include "pixel_shader.h"

namespace mpc {
namespace {

void CheckMesh(const LitMesh& lit) {
  const Eigen::Index num_vertices = lit.mesh.positions.cols();
  const auto check = [&](const char* name, Eigen::Index found, bool needed) {
    if (found == num_vertices || (found == 0 && !needed)) return;
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{} {} for {} vertices", found, name, num_vertices));
  };
  check("normals", lit.normals.cols(), false);
  check("texture coordinates", lit.uv.cols(), lit.texture != nullptr);
  check("vertex colours", lit.vertex_bgr.cols(), false);
}

void CheckArguments(const Camera& camera, const LitScene& scene, const cv::Mat& sum) {
  const auto fail = [](const std::string& text) { throw Error(ErrorCode::kInvalidArgument, text); };
  camera.Validate();
  if (!camera.has_extrinsics) fail("a lit picture needs a camera with extrinsics");
  if (std::any_of(camera.distortion.begin(), camera.distortion.end(),
                  [](double k) { return k != 0; })) {
    fail("a lit picture needs a camera without distortion");
  }
  if (sum.type() != CV_32FC4 || sum.cols != camera.width || sum.rows != camera.height) {
    fail(fmt::format("a sum of {} x {} and type {} for a camera of {} x {}", sum.cols, sum.rows,
                     sum.type(), camera.width, camera.height));
  }
  if (!scene.part.empty() && (scene.part.type() != CV_8UC1 || scene.part.size() != sum.size())) {
    fail(fmt::format("a part of {} x {} and type {} of a picture of {} x {}", scene.part.cols,
                     scene.part.rows, scene.part.type(), sum.cols, sum.rows));
  }
  for (const LitMesh* lit : scene.place) CheckMesh(*lit);
  for (const LitMesh* lit : scene.bodies) CheckMesh(*lit);
}

// Adds the pixels of one layer within `part` (empty: all) that `hidden` (ids of the layer in front;
// may be empty) leaves.
void AddLayer(const Camera& camera, const LitScene& scene, const DrawList& list,
              const RasterBuffers& buffers, const cv::Mat& part, const cv::Mat& hidden,
              const cv::Rect& hidden_bounds, cv::Mat sum) {
  PixelShader shader(camera, list, scene);
  for (int y = 0; y < camera.height; ++y) {
    const int* ids = buffers.triangle_id.ptr<int>(y);
    const float* depth = buffers.depth.ptr<float>(y);
    auto* out = reinterpret_cast<float*>(sum.ptr<cv::Vec4f>(y));
    const bool crosses = y >= hidden_bounds.y && y < hidden_bounds.y + hidden_bounds.height;
    const int* in_front =
        crosses ? hidden.ptr<int>(y - hidden_bounds.y) - hidden_bounds.x : nullptr;
    const int begin = crosses ? hidden_bounds.x : camera.width;
    const int end = crosses ? hidden_bounds.x + hidden_bounds.width : camera.width;
    const uchar* wanted = part.empty() ? nullptr : part.ptr(y);
    const auto seen = [&](int x) {
      if (wanted != nullptr && wanted[x] == 0) return -1;
      return x >= begin && x < end && in_front[x] >= 0 ? -1 : ids[x];
    };
    for (int x = 0; x < camera.width;) {
      const int first = x, id = seen(x);
      while (++x < camera.width && seen(x) == id) {
      }
      if (id >= 0) shader.Add(id, first, y, x - first, depth + first, out + 4 * first);
    }
  }
}

}  // namespace

Eigen::Matrix3Xf ToCamera(const CameraFromWorld& camera_from_world,
                          const Eigen::Matrix3Xf& x_in_world) {
  Eigen::Matrix3Xf x_in_camera(3, x_in_world.cols());
  for (Eigen::Index i = 0; i < x_in_world.cols(); ++i) {
    x_in_camera.col(i) = (camera_from_world * x_in_world.col(i).cast<double>()).cast<float>();
  }
  return x_in_camera;
}

void AddLitPicture(const Camera& camera, const LitScene& scene, cv::Mat* sum) {
  CheckArguments(camera, scene, *sum);
  const DrawList bodies = MakeDrawList(camera, scene.bodies);
  const cv::Rect bounds = ProjectedBounds(camera, bodies.positions);
  RasterBuffers front;
  if (!bounds.empty()) {
    const Camera crop = CroppedTo(camera, bounds);
    RasterizeMesh(crop, bodies.positions, bodies.triangles, {}, &front);
    const cv::Mat part = scene.part.empty() ? cv::Mat() : scene.part(bounds);
    AddLayer(crop, scene, bodies, front, part, {}, {}, (*sum)(bounds));
  }
  const DrawList place = MakeDrawList(camera, scene.place);
  RasterBuffers behind;
  RasterizeMesh(camera, place.positions, place.triangles, {}, &behind);
  AddLayer(camera, scene, place, behind, scene.part, front.triangle_id, bounds, *sum);
}

cv::Mat Developed(const cv::Mat& sum, int count) {
  // Square roots of 0 to 1 in steps fine enough for every 8-bit value to be reached.
  constexpr int kSteps = 1 << 16;
  static const std::vector<uchar> values = [] {
    std::vector<uchar> table(kSteps + 1);
    for (int i = 0; i <= kSteps; ++i) {
      table[static_cast<size_t>(i)] =
          static_cast<uchar>(std::lround(255 * std::sqrt(i / static_cast<double>(kSteps))));
    }
    return table;
  }();
  const float scale = static_cast<float>(kSteps) / static_cast<float>(count);
  cv::Mat bgr(sum.size(), CV_8UC3);
  for (int y = 0; y < sum.rows; ++y) {
    const float* in = sum.ptr<float>(y);
    uchar* out = bgr.ptr(y);
    for (int x = 0; x < sum.cols; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        const float light =
            std::clamp(in[4 * x + channel] * scale, 0.0f, static_cast<float>(kSteps));
        out[3 * x + channel] = values[static_cast<size_t>(light + 0.5f)];
      }
    }
  }
  return bgr;
}

}  // namespace mpc
