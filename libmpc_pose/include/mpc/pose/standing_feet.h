// Purpose: find when a foot stands, and where, and the floor that no foot goes through.
// Source: ours (docs/pose.md, "Standing feet").
//
// What stands still in the picture for a while stands still: a foot that moves straight along the
// ray is rare, one camera's error of a foot's depth is not. Frames: camera. A camera that moves takes
// its feet with it unless it is known where it is; then little seems to stand, and little is found.
// Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/pose/clip_evidence.h"

namespace mpc {

// Sets FrameObservation::standing of the F observations to the ankles and toes that stand in
// `poses` (N x F) and that the frame sees in 2D: where the ray meets the floor under all stands of
// the clip, and where most of its own ranges lie, each by its uncertainty; at the latter alone when
// its foot stands more than a step above or below that floor. A foot that rests only in the picture,
// while the estimate of its depth runs, stands when it does so for longer and on that floor.
// Sets FrameObservation::floor of all of them where that floor is known, under ankles and toes: at the
// height of its toes, or as deep as both feet stand when that is more than a step lower.
void FindStandingFeet(const ClipEvidence& evidence, const Eigen::MatrixXd& poses,
                      std::vector<FrameObservation>* observations);

// Empties what FindStandingFeet sets.
void ForgetStandingFeet(std::vector<FrameObservation>* observations);

}  // namespace mpc
