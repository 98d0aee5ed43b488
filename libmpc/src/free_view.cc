#include "mpc/free_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/video.h"
#include "mpc/render/model_mask.h"
#include "mpc/render/shade.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

TriangleMesh JoinedMesh(const RigAsset& rig) {
  TriangleMesh joined;
  joined.positions.resize(3, rig.num_vertices());
  int begin = 0;
  for (const RigMesh& mesh : rig.meshes) {
    const Eigen::Index first = joined.triangles.cols();
    const Triangles& triangles = mesh.mesh.triangles;
    joined.triangles.conservativeResize(3, first + triangles.cols());
    joined.triangles.rightCols(triangles.cols()) = triangles.array() + begin;
    joined.positions.middleCols(begin, mesh.mesh.positions.cols()) = mesh.mesh.positions;
    begin += static_cast<int>(mesh.mesh.positions.cols());
  }
  return joined;
}

MeshAppearance AppearanceOf(const RigAsset& rig) {
  MeshAppearance appearance;
  appearance.uv.setZero(2, rig.num_vertices());
  Eigen::Index begin = 0;
  for (const RigMesh& mesh : rig.meshes) {
    const auto number = static_cast<int>(appearance.textures.size());
    appearance.triangle_texture.insert(appearance.triangle_texture.end(),
                                       static_cast<size_t>(mesh.mesh.triangles.cols()), number);
    cv::Mat& texture = appearance.textures.emplace_back();
    if (!mesh.texture.empty() && mesh.uv.cols() > 0) {
      texture = cv::imdecode(mesh.texture, cv::IMREAD_COLOR);
      if (texture.empty()) {
        throw Error(ErrorCode::kBadFile,
                    fmt::format("{}: the texture of mesh {} is no picture", rig.source, mesh.name));
      }
      appearance.uv.middleCols(begin, mesh.uv.cols()) = mesh.uv;
    }
    begin += mesh.mesh.positions.cols();
  }
  return appearance;
}

// What lies behind the surface, frame by frame.
class Background {
 public:
  Background(const fs::path& path, const ViewedSurface& surface) : path_(path) {
    const int width = surface.camera.width, height = surface.camera.height;
    num_frames_ = surface.num_frames;
    picture_ = cv::Mat(height, width, CV_8UC3, cv::Scalar::all(48));
    if (path.empty()) return;
    std::error_code ec;
    if (fs::is_regular_file(path, ec) && cv::haveImageReader(path.string())) {
      picture_ = cv::imread(path.string(), cv::IMREAD_COLOR);
      if (picture_.empty()) {
        throw Error(ErrorCode::kBadFile, fmt::format("{}: not a readable picture", path.string()));
      }
    } else {
      video_.emplace(path, surface.fps);
    }
    const int found_width = video_ ? video_->width() : picture_.cols;
    const int found_height = video_ ? video_->height() : picture_.rows;
    if (found_width != width || found_height != height) {
      throw Error(ErrorCode::kMismatch,
                  fmt::format("{} is {} x {}, the camera's picture {} x {}", path.string(),
                              found_width, found_height, width, height));
    }
  }

  void Read(int frame, cv::Mat* picture) {
    if (!video_) {
      picture_.copyTo(*picture);
    } else if (!video_->Read(picture)) {
      throw Error(ErrorCode::kMismatch, fmt::format("{} has {} frames, the performance {}",
                                                    path_.string(), frame, num_frames_));
    }
  }

 private:
  fs::path path_;
  int num_frames_ = 0;
  cv::Mat picture_;
  std::optional<VideoReader> video_;
};

void CheckOutput(const fs::path& output, const ViewedSurface& surface, const fs::path& background) {
  std::vector<fs::path> inputs = surface.inputs;
  inputs.push_back(background);
  for (const fs::path& input : inputs) {
    std::error_code ec;
    if (input.empty() || !fs::equivalent(input, output, ec)) continue;
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{} is an input and would be overwritten", input.string()));
  }
}

}  // namespace

bool RenderSurface(const ViewedSurface& surface, const fs::path& output,
                   const RenderOptions& options, const ProgressCallback& progress) {
  CheckOutput(output, surface, options.background);
  const Camera& camera = surface.camera;
  const TriangleMesh mesh = JoinedMesh(surface.rig);
  const SurfaceTopology topology = SurfaceTopology::FromMesh(mesh);
  const MeshAppearance appearance = options.mask ? MeshAppearance() : AppearanceOf(surface.rig);
  Background background(options.background, surface);
  std::optional<VideoWriter> video;
  std::optional<PictureFolderWriter> folder;
  if (output.extension() == ".mp4") {
    video.emplace(output, camera.width, camera.height, surface.fps);
  } else {
    folder.emplace(output);
  }
  struct Work {
    Eigen::Matrix3Xf vertices;
    cv::Mat mask, picture;
  };
  std::vector<Work> chunk(static_cast<size_t>(2 * ResolveNumThreads(options.num_threads)));
  for (int begin = 0; begin < surface.num_frames;) {
    const int count = std::min(static_cast<int>(chunk.size()), surface.num_frames - begin);
    for (int i = 0; i < count; ++i) {
      Work& work = chunk[static_cast<size_t>(i)];
      surface.vertices(begin + i, &work.vertices);
      if (!options.mask) background.Read(begin + i, &work.picture);
    }
    ParallelFor(count, options.num_threads, [&](int i) {
      Work& work = chunk[static_cast<size_t>(i)];
      if (options.mask) {
        ModelMask(camera, work.vertices, topology, &work.mask);
        work.picture = work.mask;
        if (video) cv::cvtColor(work.mask, work.picture, cv::COLOR_GRAY2BGR);
      } else {
        ShadeMesh(camera, work.vertices, mesh.triangles, appearance, /*alpha=*/1, &work.picture);
      }
    });
    for (int i = 0; i < count; ++i) {
      const cv::Mat& picture = chunk[static_cast<size_t>(i)].picture;
      video ? video->Write(picture) : folder->Write(picture);
    }
    begin += count;
    if (progress && !progress({"render", begin, surface.num_frames})) return false;
  }
  video ? video->Close() : folder->Close();
  return true;
}

}  // namespace mpc
