// Purpose: a captured surface as morph targets and their weights (mpc/io/gltf.h).
// Source: Khronos glTF 2.0 specification, 3.7.2.2 (morph targets), 3.7.3 (skins): targets are added
// in the mesh's frame before linear skinning.
#pragma once

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <vector>

#include "gltf_animation.h"
#include "gltf_binary.h"
#include "gltf_document.h"
#include "mpc/io/gltf.h"

namespace mpc::internal {

// `rig` and `original` as they are written; shown: scene_from_bone per bone and frame, as
// AnimateBones returns it.
GltfSurfaceError WriteSurface(const GltfDocument& document, const GltfRig& original,
                              const RigAsset& rig, bool other_proportions,
                              const GltfPerformance& performance,
                              const std::vector<std::vector<Eigen::Affine3d>>& shown,
                              nlohmann::ordered_json* json, GltfBinary* binary,
                              AnimationWriter* animation);

}  // namespace mpc::internal
