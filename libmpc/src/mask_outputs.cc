#include "mask_outputs.h"

#include <fmt/format.h>

#include <optional>

#include "mpc/io/mask_file.h"
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
  if (!outputs.overlay.empty()) overlay.emplace(outputs.overlay, width, height, fps);
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
