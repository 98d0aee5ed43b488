// Purpose: a captured clip refined to its silhouettes, frame by frame to the caller: silhouette,
// pose, silhouette again, surface, smoothing.
// Source: paper, Section 5.
// Frames: poses and vertices in the camera frame. Units: metres, pixels.
// Symbols: N dofs, F frames, V vertices.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/core/progress.h"
#include "mpc/deform/frame_refiner.h"
#include "mpc/deform/temporal_smoothing.h"
#include "mpc/silhouettes.h"

namespace mpc {

struct ClipRefinementOptions {
  SilhouetteOptions silhouettes;  // its num_threads is that of all frames
  SegmentationOptions second_extraction = SegmentationOptions::AfterRefinement();
  FrameRefinementOptions frames;
  SmoothingOptions smoothing;
  // Pictures are looked at in half their size, or a quarter and so on, as long as the person stays taller
  // than this in them; 0: as they are; ours.
  double person_px = 400;

  static ClipRefinementOptions Paper();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

// What is known of one frame. Its silhouette is that of the last extraction, and there the model is
// the mesh at the refined pose.
struct RefinementRecord {
  SilhouetteRecord silhouette;
  RefinementState pose_state = RefinementState::kNoSilhouette;
  RefinementState surface_state = RefinementState::kNoSilhouette;
  double pose_support = 0;  // see PoseRefinement
  double surface_support = 0;
  // Intersection over union with the true mask; NaN without one.
  double batch_true_iou = std::numeric_limits<double>::quiet_NaN();    // of the mesh as given
  double surface_true_iou = std::numeric_limits<double>::quiet_NaN();  // of the result
};

struct RefinedFrame {
  int index = 0;
  const Eigen::VectorXd& pose;       // N
  const Eigen::Matrix3Xf& vertices;  // 3xV, the final surface
  const cv::Mat& silhouette;         // CV_8UC1
  const cv::Mat& picture;            // of the video, CV_8UC3
};

using RefinementSink = std::function<void(const RefinedFrame&)>;

struct ClipRefinement {
  Eigen::MatrixXd poses;                 // N x F
  std::vector<RefinementRecord> frames;  // fewer than F when the callback stopped the work
  double surface_s = 0;                  // processor time of refining surfaces alone, all threads
};

// Hands the frames to `sink` in their order, from the calling thread. Reports progress as stage
// "refinement". Memory does not grow with the clip but for `poses` and records: it holds
// two decoded frames per thread and those of the smoothing's window. Results do not depend on the number of
// threads. Throws Error as ExtractSilhouettes and FrameRefiner.
ClipRefinement RefineClip(const PosedClip& clip, const ClipRefinementOptions& options,
                          const RefinementSink& sink, const ProgressCallback& progress = {});

}  // namespace mpc
