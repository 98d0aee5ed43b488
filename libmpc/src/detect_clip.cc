#include "mpc/detect_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "mpc/core/error.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/video.h"
#include "mpc/render/draw.h"
#include "outputs.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

// False when the callback stopped it: then there is no file.
bool WriteDetectionOverlay(const fs::path& path, const ClipToDetect& clip,
                           const Detections2d& detections, const ProgressCallback& progress) {
  VideoReader video(clip.video, clip.image_fps);
  VideoWriter writer(path, video.width(), video.height(), video.fps());
  const auto num_frames = static_cast<int>(detections.frames.size());
  cv::Mat picture;
  for (int f = 0; f < num_frames && video.Read(&picture); ++f) {
    const Detections2d::Frame& frame = detections.frames[static_cast<size_t>(f)];
    DrawStickFigure(detections.joints, frame, &picture);
    DrawDetections(detections.joints, frame, &picture);
    writer.Write(picture);
    if (progress && !progress({"overlay", f + 1, num_frames})) return false;
  }
  writer.Close();
  return true;
}

}  // namespace

ClipDetections DetectClip(const ClipToDetect& clip, const ClipDetectorOptions& options,
                          const ProgressCallback& progress) {
  const PoseModels models = FindPoseModels(clip.models);
  VideoReader video(clip.video, clip.image_fps);
  ClipDetector detector(models, video.width(), video.height(), video.fps(), options);
  cv::Mat picture;
  for (int num_frames = 1; video.Read(&picture); ++num_frames) {
    detector.Add(picture);
    if (progress && !progress({"detect", num_frames, std::max(video.num_frames(), num_frames)})) {
      throw Error(ErrorCode::kCancelled, "stopped while people were looked for");
    }
  }
  try {
    return detector.Finish();
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: {}", clip.video.string(), e.what()));
  }
}

std::vector<std::string> DetectionWarnings(const ClipDetections& detections) {
  std::vector<std::string> warnings;
  if (detections.num_persons > 1) {
    warnings.push_back(fmt::format("{} people are in view; one was chosen (--person, --at)",
                                   detections.num_persons));
  }
  if (detections.num_seen < detections.num_looks) {
    warnings.push_back(fmt::format("the person was found in {} of {} frames looked at",
                                   detections.num_seen, detections.num_looks));
  }
  return warnings;
}

ClipDetections DetectToFolder(const ClipToDetect& clip, const fs::path& output,
                              const ClipDetectorOptions& options, bool overlay,
                              const ProgressCallback& progress) {
  internal::PrepareOutput(output, std::array{clip.video},
                          std::array{kDetections2dName, kDetections3dName, internal::kOverlayName});
  ClipDetections detections = DetectClip(clip, options, progress);
  WriteDetections(output / kDetections2dName, detections.detections2d);
  WriteDetections(output / kDetections3dName, detections.detections3d);
  if (overlay && !WriteDetectionOverlay(output / internal::kOverlayName, clip,
                                        detections.detections2d, progress)) {
    throw Error(ErrorCode::kCancelled, "stopped while the overlay was drawn");
  }
  return detections;
}

}  // namespace mpc
