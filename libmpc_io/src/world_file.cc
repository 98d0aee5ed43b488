#include "mpc/io/world_file.h"

#include "json_file.h"
#include "mpc/io/atomic_file.h"

namespace mpc {
namespace {

using internal::JsonPlace;

template <typename To, typename From>
void Parse(const JsonPlace& place, Rigid<To, From>* transform) {
  place["R"].ExpectSize(3);
  place["t"].ExpectSize(3);
  for (size_t r = 0; r < 3; ++r) {
    const JsonPlace row = place["R"][r];
    row.ExpectSize(3);
    const auto i = static_cast<Eigen::Index>(r);
    for (size_t c = 0; c < 3; ++c) {
      transform->rotation(i, static_cast<Eigen::Index>(c)) = row[c].Number();
    }
    transform->translation[i] = place["t"][r].Number();
  }
  const Eigen::Matrix3d& rotation = transform->rotation;
  if (!(rotation * rotation.transpose()).isIdentity(1e-6) || !(rotation.determinant() > 0)) {
    place["R"].Fail("is no rotation");
  }
}

}  // namespace

WorldPlacement ReadWorld(const std::filesystem::path& report) {
  const nlohmann::ordered_json json = internal::ParseJson(ReadFile(report), report.string());
  const JsonPlace root(json, report.string());
  if (!root.Has("format") || root["format"].String() != "mpc-report") {
    root.Fail("has no format \"mpc-report\"");
  }
  WorldPlacement world;
  Parse(root["world"]["world_from_camera"], &world.world_from_camera);
  Parse(root["world"]["scene_from_world"], &world.scene_from_world);
  const JsonPlace frames = root["frames"];
  for (size_t f = 0; f < frames.Size() && frames[f].Has("world_from_camera"); ++f) {
    Parse(frames[f]["world_from_camera"], &world.moving_world_from_camera.emplace_back());
  }
  const size_t num_moving = world.moving_world_from_camera.size();
  if (num_moving != 0) frames.ExpectSize(num_moving);
  return world;
}

}  // namespace mpc
