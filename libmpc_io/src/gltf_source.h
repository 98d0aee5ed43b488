// Purpose: what of a source file goes into the written one.
#pragma once

#include <nlohmann/json.hpp>

#include "gltf_binary.h"
#include "gltf_document.h"

namespace mpc::internal {

// Drops the animations and the data that only they used. Extensions named EXT_ may refer to
// accessors in ways unknown here: then the data stays, and only the animations go.
void DropAnimations(const GltfDocument& document, nlohmann::ordered_json* json);

// Gathers all buffers and all images that lay beside the file into the one buffer of a .glb.
void GatherData(const GltfDocument& document, nlohmann::ordered_json* json, GltfBinary* binary);

}  // namespace mpc::internal
