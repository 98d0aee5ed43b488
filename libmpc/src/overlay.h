// Purpose: overlay.mp4: the captured mesh, its skeleton, silhouette and detections over the video.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "mpc/core/detections.h"
#include "mpc/core/progress.h"
#include "mpc/io/video.h"
#include "mpc/pose/pose_estimator.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/world.h"

namespace mpc::internal {

struct OverlayScene {
  const Character& character;  // whose poses the track holds
  const Camera& camera;
  const Detections2d& detections;
  const PoseTrack& track;
  const WorldPlacement& world;
  // Of the same capture; empty: no outlines, and the skinned mesh.
  std::filesystem::path masks;
  std::filesystem::path surface;
};

// The outline of a mask (CV_8UC1) on a picture of its size.
void DrawOutline(const cv::Mat& mask, cv::Mat* picture);

// Draws the video frame by frame, a few at a time. Reports progress as stage "overlay"; false when
// the callback stopped it: then there is no file. Throws Error (kBadFile, kWriteFailed).
bool WriteOverlay(const std::filesystem::path& path, VideoReader video, const OverlayScene& scene,
                  int num_threads, const ProgressCallback& progress);

}  // namespace mpc::internal
