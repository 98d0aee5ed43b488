// Purpose: choose each limb's depth over the whole clip. A limb seen by one camera has a mirror
// image in depth bone by bone; networks often report the wrong one for a second, and a local solver
// stays in whichever it was started in.
// Source: ours (docs/pose.md, "Depth hypotheses"); off in the paper preset.
//
// Per frame and limb the candidates are: the limb as it is; its upper, lower or both bones mirrored
// along the viewing ray, fitted to the 2D points with depths so mirrored and to the frame's evidence
// from there; and the limb as detected and fitted. The torso is held. One path through the candidates
// is chosen over all frames by dynamic programming: evidence, joint limits and rest prior per frame,
// continuity of the limb between frames.
// Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>

#include "mpc/pose/clip_evidence.h"
#include "mpc/pose/frame_initializer.h"

namespace mpc {

// Replaces the limbs' angles in `poses` (N x F) by the best path. Frames that were not observed
// keep theirs and end a path. Parallel by frames; the result does not depend on the threads.
void ChooseLimbs(const ClipEvidence& evidence, const FrameInitialization& initialization,
                 Eigen::MatrixXd* poses);

}  // namespace mpc
