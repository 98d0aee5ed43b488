#include "mask_outputs.h"

#include <fmt/format.h>

#include <optional>

#include "mpc/core/error.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/pc2.h"
#include "outputs.h"
#include "overlay.h"

namespace mpc::internal {

std::vector<SilhouetteRecord> WriteMasks(const MaskOutputs& outputs, double fps,
                                         const PosedClip& clip, const SilhouetteOptions& options,
                                         const ProgressCallback& progress) {
  const int width = clip.camera.width, height = clip.camera.height;
  MaskVideoWriter video(outputs.video, width, height, fps);
  std::optional<MaskFolderWriter> pictures;
  if (!outputs.pictures.empty()) pictures.emplace(outputs.pictures);
  std::optional<VideoWriter> overlay;
  if (!outputs.overlay.empty())
    overlay.emplace(outputs.overlay, width, height, fps, VideoEffort::kLow);
  const auto write = [&](const SilhouetteFrame& frame) {
    video.Write(frame.silhouette.mask);
    if (pictures) pictures->Write(frame.silhouette.mask);
    if (overlay) {
      cv::Mat picture = frame.picture.clone();
      DrawOutline(frame.silhouette.mask, &picture);
      overlay->Write(picture);
    }
  };
  std::vector<SilhouetteRecord> records = ExtractSilhouettes(clip, options, write, progress);
  if (static_cast<Eigen::Index>(records.size()) < clip.poses.cols()) return records;
  video.Close();
  if (pictures) pictures->Close();
  if (overlay) overlay->Close();
  return records;
}

WrittenRefinement WriteRefinement(const std::filesystem::path& output, const WorldPlacement& world,
                                  double fps, const PosedClip& clip,
                                  const ClipRefinementOptions& options,
                                  const Detections2d* detections,
                                  const ProgressCallback& progress) {
  const int width = clip.camera.width, height = clip.camera.height;
  MaskVideoWriter masks(output / kMasksName, width, height, fps);
  WrittenRefinement written;
  std::optional<VideoWriter> overlay;
  const auto try_overlay = [&](const auto& act) {
    try {
      act();
    } catch (const Error&) {
      written.overlay_error = std::current_exception();
      overlay.reset();
    }
  };
  if (detections != nullptr) {
    try_overlay(
        [&] { overlay.emplace(output / kOverlayName, width, height, fps, VideoEffort::kLow); });
  }
  std::optional<Pc2Writer> surface;
  if (options.frames.level == RefinementLevel::kSurface) {
    surface.emplace(output / kSurfaceName, static_cast<int>(clip.character.mesh.positions.cols()));
  }
  cv::Mat drawn;
  const auto write = [&](const RefinedFrame& frame) {
    masks.Write(frame.silhouette);
    if (overlay) {
      frame.picture.copyTo(drawn);
      DrawOverlay({clip.character, clip.camera, *detections}, frame.index, frame.pose,
                  frame.vertices, frame.silhouette, &drawn);
      try_overlay([&] { overlay->Write(drawn); });
    }
    if (!surface) return;
    const Rigid<SceneFrame, CameraFrame> scene_from_camera = world.SceneFromCamera(frame.index);
    surface->Write((scene_from_camera.rotation.cast<float>() * frame.vertices).colwise() +
                   scene_from_camera.translation.cast<float>());
  };
  written.refinement = RefineClip(clip, options, write, progress);
  const auto num_refined = static_cast<Eigen::Index>(written.refinement.frames.size());
  if (num_refined < clip.poses.cols()) return written;
  masks.Close();
  if (surface) surface->Close();
  if (overlay) try_overlay([&] { overlay->Close(); });
  return written;
}

void AddRefinementWarnings(const std::vector<RefinementRecord>& records,
                           std::vector<std::string>* warnings) {
  std::vector<SilhouetteRecord> silhouettes;
  int num_unmatched = 0;
  for (const RefinementRecord& record : records) {
    silhouettes.push_back(record.silhouette);
    num_unmatched += record.pose_state == RefinementState::kNoMatch ? 1 : 0;
  }
  AddSilhouetteWarnings(silhouettes, warnings);
  if (num_unmatched > 0) {
    warnings->push_back(
        fmt::format("{} of {} poses do not fit their silhouettes and were not refined",
                    num_unmatched, records.size()));
  }
}

void AddSilhouetteWarnings(const std::vector<SilhouetteRecord>& records,
                           std::vector<std::string>* warnings) {
  int num_uncut = 0;
  int num_without_model = 0;
  for (const SilhouetteRecord& record : records) {
    num_uncut += record.state == SilhouetteState::kAmbiguous ||
                         record.state == SilhouetteState::kNoBackground
                     ? 1
                     : 0;
    num_without_model += record.state == SilhouetteState::kNoModel ? 1 : 0;
  }
  const auto add = [&](int count, const char* what) {
    if (count > 0) {
      warnings->push_back(fmt::format("{} of {} silhouettes {}", count, records.size(), what));
    }
  };
  add(num_uncut, "could not be told from the background and are the model's own");
  add(num_without_model, "are empty: the actor is outside of the picture");
}

}  // namespace mpc::internal
