// Purpose: a performance of a dressed actor: skin that follows the bones, cloth that moves on its
// own.
// Source: position-based dynamics with compliance (Macklin et al. 2016, "XPBD", and 2019, "Small
// Steps in Physics Simulation"); dual-quaternion skinning.
// Frames: world, y up, floor at y = 0. Units: metres, seconds. Symbols: N dofs, F frames, V
// vertices.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/progress.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/skeleton/character.h"

namespace mpc {

// The exact vertices of every frame: F times 3xV, in the order of character.mesh. `character` is
// BuildCharacter of the actor's rig; an actor without cloth (anybody's rig) is plainly skinned.
// Poses are N x F. The cloth has come to rest at the first pose, moving along with it, before frame
// 0; between frames the poses are interpolated. Deterministic, single-threaded; a second of
// performance costs about as much at any frame rate. Reports progress as stage "cloth".
// Throws Error: kMismatch for a character of another rig; kInvalidArgument for poses of the wrong
// size or that are not finite, and for fps outside [1, 1000]; kCancelled when the callback stops it.
std::vector<Eigen::Matrix3Xf> Perform(const DressedActor& actor, const Character& character,
                                      const Eigen::MatrixXd& poses_in_world, double fps,
                                      const ProgressCallback& progress = {});

}  // namespace mpc
