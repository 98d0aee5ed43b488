// Purpose: how a camera turns that nobody calibrated, from the background in its video.
// Source: ours, docs/pose.md, "Cameras that turn". What the camera goes is taken for a turn: a person holds
// it at arm's length and most of what is seen behind an actor is far away.
// Frames: the world is the first frame's camera. Units: pixels, radians. Symbols: F frames.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/core/progress.h"
#include "mpc/io/video.h"

namespace mpc::internal {

// A mask (CV_8UC1) of the picture around the person that was detected: no background.
cv::Mat PersonBox(const Detections2d::Frame& person, const cv::Size& size);

// Where a camera sees a background after a turn (from directions before to directions after): from its pixels
// before.
Eigen::Matrix3d HomographyOfTurn(const Eigen::Matrix3d& turn, const Camera& camera);

// The turn that takes directions in one picture's camera to those in the other's, for the homography that
// takes the one's pixels to the other's; nullopt if it is not what a camera sees that turns.
std::optional<Eigen::Matrix3d> TurnOfHomography(const cv::Matx33d& homography,
                                                const Camera& camera);

// Whether the background is where it was in half of the pictures of a clip, each against the one before;
// `frames` says which frames they are.
bool CameraRests(std::span<const cv::Mat> pictures, std::span<const int> frames,
                 const Detections2d& detections);

struct TurningCamera {
  std::vector<CameraFromWorld> places;  // F, without translation
  double largest_rad = 0;               // turn from the first frame
  int num_unseen = 0;                   // frames that kept the turn of the frame before
};

// Looks at every frame of the video (F, as many as detections); reports progress as stage "camera". Nothing when the callback stopped
// it. Throws Error as the reader.
std::optional<TurningCamera> FollowCamera(VideoReader video, const Camera& camera,
                                          const Detections2d& detections,
                                          const ProgressCallback& progress);

}  // namespace mpc::internal
