// Purpose: a frame's detected 3D joints placed on a pose, so that each counts for itself.
// Source: t_f of the paper, Section 4, held at its best value for a given pose; scale and robustness
// are ours. Frames: camera axes. Units: metres. Symbols: J joints of the skeleton.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/pose/bone_vector_energy.h"
#include "mpc/pose/clip_evidence.h"

namespace mpc {

// The vectors from joint `origin` of the pose to every detected joint, scaled and shifted so that they
// come nearest to `joints` (3xJ, of the pose); detections farther from it than about three times
// `typical_m` do not count in that. Weights are the detections' confidences.
std::vector<BoneObservation> AnchorJoints(const FrameObservation& observation,
                                          const Eigen::Matrix3Xd& joints, int origin,
                                          double typical_m);

}  // namespace mpc
