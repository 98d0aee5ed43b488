// Purpose: one camera inside a JSON file (docs/formats.md, "Cameras").
#pragma once

#include "json_file.h"
#include "mpc/core/camera.h"

namespace mpc::internal {

// A camera without a name is called "camera<index>". Throws Error (kBadFile, kUnsupported).
Camera ParseCamera(const JsonPlace& place, size_t index);

// Throws Error (kInvalidArgument) for a camera that does not validate.
nlohmann::ordered_json CameraToJson(const Camera& camera);

}  // namespace mpc::internal
