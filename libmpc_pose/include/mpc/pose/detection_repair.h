// Purpose: detections that contradict their own neighbours in time, or are missing for a moment.
// Source: ours (docs/pose.md, "Repair"). A robust quadratic is fitted to a joint's neighbours in time; a
// detection far from it, measured by how the neighbours scatter, is replaced by the fit, and so is one
// that is missing between others. Everything else stays as it is.
#pragma once

#include "mpc/core/detections.h"

namespace mpc {

// Repaired detections have half the confidence of their neighbours. Clips with fewer than 15 frames
// per second are returned as they are: too few frames see the same movement. O(F J).
Detections2d RepairDetections(const Detections2d& detections, double fps);
Detections3d RepairDetections(const Detections3d& detections, double fps);

}  // namespace mpc
