// Purpose: a character's skeleton as solid limbs, as thick as its mesh: the skeleton mask R.
// Source: paper, Section 5.1 (rasterised skeleton); the thickness is ours.
// Frames: "body" is the frame of the pose's root. Units: metres. Symbols: S segments, V vertices.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/capsule_set.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {

// A bone from a segment's origin to a point fixed in the segment.
struct Limb {
  int segment = 0;
  Eigen::Vector3d end_in_segment = Eigen::Vector3d::Zero();
  double radius = 0;  // median distance from the bone of the mesh around it, at bind
};

// One limb from each segment's origin to each child's, and in segments without children to the
// farthest joint (head top, wrists, toes). A vertex belongs to its heaviest segment and there to
// the nearest bone it lies beside; a bone without vertices has radius 0. O(V).
std::vector<Limb> FindLimbs(const Character& character);

// The limbs at a pose: one capsule each, in the body frame.
CapsuleSet PoseLimbs(const std::vector<Limb>& limbs, const KinematicState& state);

}  // namespace mpc
