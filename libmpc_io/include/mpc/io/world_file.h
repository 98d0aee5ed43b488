// Purpose: where a finished capture stands: the transforms of its report.json.
// Frames, units: as docs/conventions.md, "World".
#pragma once

#include <filesystem>

#include "mpc/skeleton/world.h"

namespace mpc {

// Reads `world` of a report.json, and of a moving camera the places in its frames. Throws Error:
// kFileNotFound, kBadFile (naming the place).
WorldPlacement ReadWorld(const std::filesystem::path& report);

}  // namespace mpc
