// Purpose: write a rigged mesh made by a program, such as the procedural actor, as glTF.
// Source: Khronos glTF 2.0 specification, section 3.7.3 (skins).
// Frames: scene frame, right-handed, y up. Units: metres.
#pragma once

#include <filesystem>

#include "mpc/skeleton/rig_asset.h"

namespace mpc {

// Writes a .glb that ReadRigGltf reads back as the same rig (positions and weights as floats): one
// node per bone under a node "armature", one skin, one node and material per mesh, normals computed.
// A mesh's texture becomes the base colour of its material, embedded as it is; without one the
// material is plain grey. Throws Error: kBadFile for a rig that does not validate or a texture that
// is no PNG or JPEG or has no texture coordinates, kWriteFailed.
void WriteRigGltf(const std::filesystem::path& path, const RigAsset& rig);

}  // namespace mpc
