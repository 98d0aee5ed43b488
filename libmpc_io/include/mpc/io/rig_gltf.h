// Purpose: write a rigged mesh made by a program, such as the procedural actor, as glTF.
// Source: Khronos glTF 2.0 specification, section 3.7.3 (skins).
// Frames: scene frame, right-handed, y up. Units: metres.
#pragma once

#include <filesystem>

#include "mpc/skeleton/rig_asset.h"

namespace mpc {

// Writes a .glb that ReadRigGltf reads back as the same rig (positions and weights as floats): one
// node per bone under a node "armature", one skin, one node and plain material per mesh, normals
// computed. Throws Error: kBadFile for a rig that does not validate, kWriteFailed.
void WriteRigGltf(const std::filesystem::path& path, const RigAsset& rig);

}  // namespace mpc
