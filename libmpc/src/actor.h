// Purpose: an actor's file as rig and character, with the height that the user wants.
// Units: metres.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc::internal {

struct Actor {
  RigAsset rig;
  RigMap mapping;
  Character character;
  double height_scale = 1;  // that was applied to both
  std::vector<std::string> warnings;
};

// height_m: the actor is scaled to it; 0: as in the file. Throws Error: what the reader throws, and
// kUnsupported for an actor that is not 0.5 to 2.5 m tall then.
Actor LoadActor(const std::filesystem::path& path, double height_m);

}  // namespace mpc::internal
