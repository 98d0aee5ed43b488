// Purpose: the body proportions of the person in the clip, estimated once per clip.
// Source: ours (docs/pose.md, "Proportions"): the paper's template has the actor's own proportions.
// Scales and the poses of a spread of frames are solved together (Gauss-Newton, frames eliminated
// by a Schur complement), robustly, with a prior at the rig's own lengths.
// Units: scales without unit, relative to the rig. Symbols: P body parts.
#pragma once

#include <array>

#include "mpc/core/progress.h"
#include "mpc/pose/clip_evidence.h"
#include "mpc/pose/frame_initializer.h"
#include "mpc/skeleton/proportions.h"

namespace mpc {

// Standard deviation of each part's scale, relative, from the curvature of the cost; equal to the
// prior's where the clip says nothing.
struct ProportionsUncertainty {
  std::array<double, kNumBodyParts> part{};
};

struct CalibrationResult {
  Proportions proportions;
  ProportionsUncertainty uncertainty;
  bool cancelled = false;  // stopped by the callback: the scales so far
};

// Estimates the parts' scales from `evidence` (its skeleton is the rig's own) and the frames'
// initial poses. Without observed frames the result is the rig itself. The overall scale stays 1:
// one camera cannot tell a large person far away from a small one near by. Reports progress per
// iteration as stage "proportions".
CalibrationResult CalibrateProportions(const ClipEvidence& evidence,
                                       const FrameInitialization& initialization,
                                       const ProgressCallback& progress = {});

}  // namespace mpc
