// Purpose: a start for the batch: every frame's pose on its own, robust to any facing and to gaps.
// Source: paper, Section 4, "Initialization and Optimization".
// Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/pose/observations.h"
#include "mpc/pose/pose_options.h"

namespace mpc {

struct FrameInitialization {
  Eigen::MatrixXd poses;       // N x F; frames without detections are interpolated
  std::vector<bool> observed;  // F: the frame had enough detections to be solved on its own
  std::vector<double> cost;    // F: plain-square cost of the frame's solution, 0 where not observed
};

// Solves each frame from the 3D detection's orientation, from the previous frame and from rest, and
// keeps the best. Frames with fewer than four 2D joints, or whose solve fails, are filled in between
// their neighbours (rotations on the sphere). Throws Error (kMismatch) when no frame at all has
// enough detections.
FrameInitialization InitializeFrames(const Skeleton& skeleton,
                                     const std::vector<EvidenceBone>& bones, const Camera& camera,
                                     const std::vector<FrameObservation>& observations,
                                     const PoseOptions& options);

// Distance (m) along the optical axis of a pose's root; what the unit of 2D residuals needs.
double PersonDepth(const Eigen::VectorXd& pose);

// Linear blend of two poses, the root rotation on SO(3); w = 0 gives a, 1 gives b.
Eigen::VectorXd BlendPoses(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double w);

}  // namespace mpc
