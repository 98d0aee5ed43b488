// Purpose: the refined frames of a clip, smoothed over time as they come: frames go in, in their
// order, and come out a window later.
// Source: paper, end of Section 5; mpc/deform/temporal_smoothing.h.
// Frames: camera frame. Units: metres. Symbols: N dofs, V vertices.
#pragma once

#include <Eigen/Core>
#include <deque>

#include "mpc/deform/frame_refiner.h"
#include "mpc/deform/temporal_smoothing.h"
#include "mpc/skeleton/character.h"

namespace mpc {

struct SmoothedFrame {
  Eigen::VectorXd pose;       // N
  Eigen::Matrix3Xf vertices;  // 3xV, the final surface
};

class RefinementSmoother {
 public:
  // fps: frames per second. Refers to `character`, which must outlive it. Throws Error
  // (kInvalidArgument) for bad options.
  RefinementSmoother(const Character& character, double fps, const SmoothingOptions& options);

  // The next frame.
  void Push(const Eigen::VectorXd& batch_pose, FrameRefinement frame);

  // There is none after the last one pushed.
  void End() { ended_ = true; }

  // The next smoothed frame; false while frames after it are still needed, or when all came out.
  bool Pop(SmoothedFrame* frame);

 private:
  struct Entry {
    Eigen::VectorXd batch_pose;
    FrameRefinement refinement;  // its depth smoothed before depth_next_
    Eigen::Vector3d centre;      // of the refined joints
    double depth;                // m away from the camera by the refinement; NaN: not refined
    double shift;                // m, by the smoothing of that
  };

  void SmoothDepth();
  const Entry& entry(int f) const { return window_[static_cast<size_t>(f - first_)]; }
  int end() const { return first_ + static_cast<int>(window_.size()); }  // of what was pushed

  const Character* character_;
  SmoothingOptions options_;
  int depth_reach_;
  std::deque<Entry> window_;  // frames first_ to first_ + size - 1
  int first_ = 0;
  int depth_next_ = 0;  // whose depth is to be smoothed
  int next_ = 0;        // to come out
  bool ended_ = false;
};

}  // namespace mpc
