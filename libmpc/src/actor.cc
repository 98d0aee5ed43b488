#include "actor.h"

#include <fmt/format.h>

#include "mpc/core/error.h"
#include "mpc/io/gltf.h"
#include "mpc/skeleton/proportions.h"

namespace mpc::internal {
namespace {

constexpr double kMinHeightM = 0.5;  // of a person; outside, a rig is in other units than metres
constexpr double kMaxHeightM = 2.5;

}  // namespace

Actor LoadActor(const std::filesystem::path& path, double height_m) {
  Actor actor;
  actor.rig = ReadRigGltf(path);
  actor.mapping = MapRigByNames(actor.rig);
  for (const std::string& fault : CheckWeights(actor.rig)) {
    actor.warnings.push_back(path.string() + ": " + fault);
  }
  actor.character = BuildCharacter(actor.rig, actor.mapping);
  if (height_m > 0) actor.height_scale = ScaleToHeight(height_m, &actor.character, &actor.rig);
  const double height = ActorHeight(actor.character);
  if (height < kMinHeightM || height > kMaxHeightM) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{}: the actor is {:.4g} m tall, expected {} to {} m: give its height",
                            path.string(), height, kMinHeightM, kMaxHeightM));
  }
  return actor;
}

}  // namespace mpc::internal
