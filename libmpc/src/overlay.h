// Purpose: overlay.mp4: the captured mesh, its skeleton, silhouette and detections over the video.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core.hpp>

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/core/progress.h"
#include "mpc/io/video.h"
#include "mpc/skeleton/character.h"

namespace mpc::internal {

struct OverlayScene {
  const Character& character;
  const Camera& camera;
  const Detections2d& detections;
};

// The outline of a mask (CV_8UC1) on a picture of its size.
void DrawOutline(const cv::Mat& mask, cv::Mat* picture);

// One frame: its pose (N), surface (3xV, camera frame) and silhouette on its picture.
void DrawOverlay(const OverlayScene& scene, int frame, const Eigen::VectorXd& pose,
                 const Eigen::Matrix3Xf& surface, const cv::Mat& silhouette, cv::Mat* picture);

// Draws the skinned mesh of all poses (N x F) over the video, a few frames at a time. Reports progress
// as stage "overlay"; false when the callback stopped it: then there is no file. Throws Error
// (kBadFile, kWriteFailed).
bool WriteOverlay(const std::filesystem::path& path, VideoReader video, const OverlayScene& scene,
                  const Eigen::MatrixXd& poses, int num_threads, const ProgressCallback& progress);

}  // namespace mpc::internal
