// Purpose: the pose of the actor's own bones from a captured pose.
// Frames: body frame = frame of the captured root. Symbols: B bones.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc {

// body_from_bone for every bone, B entries: each bone follows its segment rigidly from the bind
// pose, so the mesh skinned by the rig's own bones equals the captured mesh. Sizes the output.
void RigBoneTransforms(const RigAsset& rig, const Character& character, const KinematicState& state,
                       std::vector<Eigen::Affine3d>* body_from_bone);

}  // namespace mpc
