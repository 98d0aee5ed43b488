// Purpose: what an actor sits on.
// Source: ours. Frames: world, y up, floor at y = 0. Units: metres. Symbols: N dofs.
#pragma once

#include <Eigen/Core>

#include "mpc/eval/dressed_actor.h"
#include "mpc/skeleton/character.h"

namespace mpc {

// A wooden stool at rest on the floor, its square seat along the axes of the world.
struct Stool {
  Eigen::Vector3d top = Eigen::Vector3d::Zero();  // the middle of the seat
  double side_m = 0.29;
};

// What an actor sits on who acts MotionKind::kSit from `first_pose` on (N, world), whether or not a clip
// lasts until then. The body, without the cloth that hangs from it, sinks into the seat by a
// centimetre. Throws Error: kInvalidArgument as MakeMotion; kUnsupported when there is no room for a stool
// under the body.
Stool StoolUnder(const DressedActor& actor, const Character& character,
                 const Eigen::VectorXd& first_pose);

}  // namespace mpc
