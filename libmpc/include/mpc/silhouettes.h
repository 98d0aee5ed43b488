// Purpose: the silhouette of a posed actor in every frame of a clip, frame by frame to the caller.
// Source: paper, Section 5.1; the cut itself: mpc/seg/silhouette.h.
// Frames: poses in the camera frame; pictures with pixel centres at integers. Units: pixels.
// Symbols: N dofs, F frames, M mask of the actor's mesh, R mask of its skeleton.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <limits>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/progress.h"
#include "mpc/detect/person_mask.h"
#include "mpc/seg/silhouette.h"
#include "mpc/skeleton/character.h"

namespace mpc {

struct SilhouetteOptions {
  SegmentationOptions segmentation;
  double limb_thickness = 1.0 / 3;  // of the limbs in R, of their own thickness; 0: lines; ours
  int num_threads = 0;              // 0: all cores; results do not depend on it

  // Full GrabCut energy and R as lines, not clipped to M.
  static SilhouetteOptions Paper();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

// The frames whose pictures show what is behind the actor: evenly over the clip, all of a short one.
std::vector<int> BackgroundFrames(int num_frames);

// A clip with its posed actor; what is referred to must outlive the call.
struct PosedClip {
  std::filesystem::path video;
  double image_fps = 0;  // frame rate when `video` is a folder of pictures
  const Camera& camera;  // for the video's own resolution
  const Character& character;
  const Eigen::MatrixXd& poses;  // N x F, as many frames as the video
  // Video, or folder of pictures in the order of their names; as many frames as the video.
  std::filesystem::path masks = {};       // the user's own, in place of extraction; empty: none
  std::filesystem::path true_masks = {};  // only to be compared with; empty: none
  // The networks' masks of the person, at most person_gap frames apart (ClipDetections): they join
  // what the pictures say. Empty: none.
  std::span<const PersonMask> person_masks = {};
  int person_gap = 1;
  // PoseTrack::error_2d_mm: poses from better detections are held more firmly.
  double error_2d_mm = 20;
  // Where a moving camera was in every frame; empty: it rests, or nobody knows.
  std::span<const CameraFromWorld> camera_motion = {};
  // Pictures of BackgroundFrames(F), kept when the video was read before; they are taken out of here.
  // Null, or not as many: the video is read for them.
  std::vector<cv::Mat>* background = nullptr;
};

// What is known of one frame's silhouette.
struct SilhouetteRecord {
  SilhouetteState state = SilhouetteState::kNoModel;
  double confidence = 0;  // see Silhouette
  double model_iou = 0;   // of the silhouette and M
  bool camera_motion = false;
  // Intersection over union with the true mask; NaN without one.
  double true_iou = std::numeric_limits<double>::quiet_NaN();        // of the silhouette
  double model_true_iou = std::numeric_limits<double>::quiet_NaN();  // of M
};

struct SilhouetteFrame {
  int index = 0;
  const cv::Mat& picture;  // CV_8UC3
  const cv::Mat& model;    // M, CV_8UC1
  const Silhouette& silhouette;
};

using SilhouetteSink = std::function<void(const SilhouetteFrame&)>;

// Hands the frames to `sink` in their order, from the calling thread. Reports progress as stage
// "silhouettes"; a callback that returns false ends the work: then there are fewer than F records.
// Holds two decoded frames per thread. Throws Error: kMismatch for masks or a video with another
// size or number of frames, and what readers, ExtractSilhouette and the sink throw.
std::vector<SilhouetteRecord> ExtractSilhouettes(const PosedClip& clip,
                                                 const SilhouetteOptions& options,
                                                 const SilhouetteSink& sink,
                                                 const ProgressCallback& progress = {});

}  // namespace mpc
