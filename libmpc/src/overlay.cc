#include "overlay.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "mpc/core/thread_pool.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/pc2.h"
#include "mpc/render/draw.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace mpc::internal {
namespace {

struct OverlayFrame {
  cv::Mat picture;
  cv::Mat mask;              // empty: no outline
  Eigen::Matrix3Xf surface;  // in the scene; empty: the skinned mesh
};

void DrawFrame(const OverlayScene& scene, int f, OverlayFrame* frame) {
  cv::Mat* const picture = &frame->picture;
  KinematicState state;
  ForwardKinematics(scene.character.skeleton, scene.track.poses.col(f), &state);
  Eigen::Matrix3Xf vertices;
  if (frame->surface.cols() > 0) {
    const Rigid<CameraFrame, SceneFrame> camera_from_scene =
        scene.world.SceneFromCamera(f).Inverse();
    vertices = (camera_from_scene.rotation.cast<float>() * frame->surface).colwise() +
               camera_from_scene.translation.cast<float>();
  } else {
    SkinCharacter(scene.character, state, &vertices);
  }
  DrawMeshOverlay(scene.camera, vertices, scene.character.mesh.triangles, picture);
  if (!frame->mask.empty()) DrawOutline(frame->mask, picture);
  const std::vector<SkeletonJoint>& joints = scene.character.skeleton.joints;
  std::vector<JointId> ids;
  for (const SkeletonJoint& joint : joints) ids.push_back(joint.id);
  DrawStickFigure(scene.camera, ids, state.joints, picture);
  DrawDetections(scene.detections.joints, scene.detections.frames[static_cast<size_t>(f)], picture);
}

}  // namespace

void DrawOutline(const cv::Mat& mask, cv::Mat* picture) {
  const cv::Scalar yellow(0, 230, 255);
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(mask, outlines, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
  const int thickness = std::max(1, std::max(picture->cols, picture->rows) / 900);
  cv::drawContours(*picture, outlines, -1, yellow, thickness, cv::LINE_AA);
}

bool WriteOverlay(const std::filesystem::path& path, VideoReader video, const OverlayScene& scene,
                  int num_threads, const ProgressCallback& progress) {
  const int num_frames = static_cast<int>(scene.track.frames.size());
  VideoWriter writer(path, video.width(), video.height(), video.fps());
  std::optional<MaskReader> masks;
  if (!scene.masks.empty()) masks.emplace(scene.masks, video.width(), video.height());
  std::optional<Pc2Reader> surface;
  if (!scene.surface.empty()) surface.emplace(scene.surface);
  std::vector<OverlayFrame> frames(static_cast<size_t>(2 * ResolveNumThreads(num_threads)));
  for (int begin = 0; begin < num_frames;) {
    int count = 0;
    while (count < static_cast<int>(frames.size()) && begin + count < num_frames &&
           video.Read(&frames[static_cast<size_t>(count)].picture)) {
      if (masks) masks->Read(&frames[static_cast<size_t>(count)].mask);
      if (surface) surface->Read(begin + count, &frames[static_cast<size_t>(count)].surface);
      ++count;
    }
    if (count == 0) break;  // the reader tolerates a frame less than the file says
    ParallelFor(count, num_threads,
                [&](int i) { DrawFrame(scene, begin + i, &frames[static_cast<size_t>(i)]); });
    for (int i = 0; i < count; ++i) writer.Write(frames[static_cast<size_t>(i)].picture);
    begin += count;
    if (progress && !progress({"overlay", begin, num_frames})) return false;
  }
  writer.Close();
  return true;
}

}  // namespace mpc::internal
