// Purpose: the joints of a person in a video, and as files: what the capture does when it is given
// none. Units: pixels, metres, seconds.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mpc/core/progress.h"
#include "mpc/detect/clip_detector.h"

namespace mpc {

struct ClipToDetect {
  std::filesystem::path video;
  double image_fps = 0;          // frame rate when `video` is a folder of pictures
  std::filesystem::path models;  // folder of the networks; empty: DefaultModelFolder()
};

// Reports progress as stage "detect". Throws Error: kCancelled when the callback stops it, and what
// FindPoseModels, VideoReader and ClipDetector throw.
ClipDetections DetectClip(const ClipToDetect& clip, const ClipDetectorOptions& options,
                          const ProgressCallback& progress = {});

// One sentence each, of what a user should know.
std::vector<std::string> DetectionWarnings(const ClipDetections& detections);

inline constexpr const char* kDetections2dName = "detections2d.json";
inline constexpr const char* kDetections3dName = "detections3d.json";

// Writes both detections and, when asked for, overlay.mp4 into `output`, which is made when it is
// missing, each file whole or not at all. Throws Error as DetectClip, kWriteFailed, and
// kInvalidArgument when the video would be overwritten.
ClipDetections DetectToFolder(const ClipToDetect& clip, const std::filesystem::path& output,
                              const ClipDetectorOptions& options, bool overlay,
                              const ProgressCallback& progress = {});

}  // namespace mpc
