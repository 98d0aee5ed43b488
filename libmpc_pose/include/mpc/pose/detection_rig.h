// Purpose: the network's 3D detections as a skeleton motion and nothing more: the first row of the
// ablation, to show what the energies of the clip add.
// Source: paper, Results: surface refinement "applied on the results of" a per-frame 3D method.
// Frames: camera frame. Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>

#include "mpc/pose/clip_evidence.h"

namespace mpc {

// Every frame on its own: the pose whose joints come nearest to the frame's 3D detection (the paper's
// E_3d, with a rest prior for what it does not show), then moved to where it projects onto the 2D
// detections. A frame without 3D or with fewer than four 2D joints repeats its neighbour's pose or
// place. N x F. Throws Error (kMismatch) without 3D detections.
Eigen::MatrixXd RigDetections(const ClipEvidence& evidence);

}  // namespace mpc
