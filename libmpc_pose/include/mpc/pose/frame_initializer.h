// Purpose: a start for the batch: every frame's pose on its own, robust to any facing and to gaps.
// Source: paper, Section 4, "Initialization and Optimization".
// Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/progress.h"
#include "mpc/pose/clip_evidence.h"

namespace mpc {

struct FrameInitialization {
  Eigen::MatrixXd poses;                       // N x F; unobserved frames are interpolated
  std::vector<FrameObservation> observations;  // F, sides put right
  std::vector<SideSwap> swaps;                 // F: what was exchanged for that
  std::vector<bool> observed;  // F: the frame had enough detections to be solved on its own
  bool cancelled = false;      // stopped by the callback: the frames not reached are filled in
};

// Starts at the frame that explains itself best and tracks forwards and backwards, each frame tied
// to the one before. Where that does not fit, left and right are exchanged, or the frame starts anew
// from the 3D detection's orientation (without one, from four facings); the best by evidence is
// kept. Frames with fewer than four 2D joints are filled in between their neighbours (rotations on
// the sphere). Reports progress per frame as stage "start". Throws Error (kMismatch) when no frame has
// enough.
FrameInitialization InitializeFrames(const ClipEvidence& evidence,
                                     const ProgressCallback& progress = {});

// Distance (m) of a pose's root along the optical axis; what the unit of 2D residuals needs.
double PersonDepth(const Eigen::VectorXd& pose);

}  // namespace mpc
