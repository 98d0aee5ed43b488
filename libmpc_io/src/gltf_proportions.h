// Purpose: a source's meshes and skins with other proportions.
#pragma once

#include <nlohmann/json.hpp>

#include "gltf_binary.h"
#include "gltf_document.h"

namespace mpc::internal {

// Whether `rig` is not just as `original`.
bool HasOtherProportions(const RigAsset& original, const RigAsset& rig);

// Rewrites positions, normals, tangents and inverse bind matrices after `rig`. Each mesh stays in its
// own frame; the new matrices, which skin_bone_from_mesh of `original` holds then, lead from there
// to the new bones. Throws Error (kUnsupported) for a mesh with two skins.
void RewriteProportions(const GltfDocument& document, const RigAsset& rig,
                        nlohmann::ordered_json* json, GltfBinary* binary, GltfRig* original);

// Throws Error (kUnsupported) when a primitive is used with two skins: `what` cannot be done then.
void RequireOneSkin(const GltfDocument& document, const GltfRig& original, const char* what);

// The mesh's positions in the frame of its own, as a file holds them.
Eigen::Matrix3Xf PositionsInMesh(const Eigen::Affine3d& scene_from_mesh, const TriangleMesh& mesh);

}  // namespace mpc::internal
