// Purpose: skeleton motion of a whole clip from its detections.
// Source: paper, Section 4: per-frame initialisation, batches of 50 frames with 10 overlap, each
// solved on its own, blended linearly in the overlap. Proportions and depth flips are ours.
// Frames: camera frame. Units: metres, radians, mm and px where named. Symbols: N dofs, J joints of
// the skeleton, F frames.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/core/progress.h"
#include "mpc/pose/calibration.h"
#include "mpc/pose/pose_options.h"
#include "mpc/skeleton/proportions.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

enum class TrackState {
  kTracked,       // seen and explained by the pose
  kInterpolated,  // not seen: the pose comes from the neighbouring frames
  kRejected,      // seen, but the detection disagrees with the pose and was discounted
};
const char* TrackStateName(TrackState state);

struct JointReport {
  TrackState state = TrackState::kInterpolated;
  double residual_px = 0;  // distance of the projected joint from its detection; 0 when not seen
  double confidence = 0;   // detector's confidence, lowered by a large residual; in [0, 1]
};

struct FrameReport {
  TrackState state = TrackState::kInterpolated;
  double residual_px = 0;           // mean over the joints that were seen
  double confidence = 0;            // mean over the paper's 16 joints
  bool used_3d = false;             // w_f
  bool swapped_sides = false;       // left and right of the detections were exchanged
  std::vector<JointReport> joints;  // J
};

struct PoseTrack {
  Eigen::MatrixXd poses;            // N x F, every entry finite
  std::vector<FrameReport> frames;  // F
  Proportions proportions;          // the poses are those of ScaledSkeleton(skeleton, proportions)
  ProportionsUncertainty uncertainty;
  double error_2d_mm = 20;  // of the 2D detections per axis, as measured (PoseOptions::error_2d_mm)
  int num_windows = 0;
  bool cancelled =
      false;  // stopped by the callback: windows not solved hold the start of the frames
  double seconds_initialization = 0;
  double seconds_calibration = 0;
  double seconds_batch = 0;
};

// Both detections have F frames; detections3d may be null (2D only). fps > 0. camera_motion: where a
// moving camera is in each frame (F), in place of the camera's own extrinsics (in their world where
// it has any, else in a frame whose axes are roughly the camera's); empty: it stands. Reports progress
// as the stages "start" (frames), "proportions" (iterations) and "pose" (windows). Throws Error:
// kInvalidArgument (options, camera, sizes), kMismatch (frame counts differ, nobody seen in any
// frame). The result does not depend on options.num_threads.
PoseTrack EstimatePoses(const Skeleton& skeleton, const Camera& camera,
                        const Detections2d& detections2d, const Detections3d* detections3d,
                        double fps, const PoseOptions& options,
                        std::span<const CameraFromWorld> camera_motion = {},
                        const ProgressCallback& progress = {});

}  // namespace mpc
