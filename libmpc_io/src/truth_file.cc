#include "mpc/io/truth_file.h"

#include <fmt/format.h>

#include <array>
#include <system_error>
#include <utility>

#include "json_file.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;
using internal::JsonPlace;
using Json = nlohmann::ordered_json;

constexpr const char* kFileName = "truth.json";
constexpr const char* kTruthFormat = "mpc-truth";
constexpr int kTruthVersion = 1;

constexpr std::array kTexts = {
    std::pair{"motion", &TruthClip::motion}, std::pair{"outfit", &TruthClip::outfit},
    std::pair{"camera_motion", &TruthClip::camera_motion}, std::pair{"noise", &TruthClip::noise}};
constexpr std::array kFiles = {std::pair{"video", &TruthClip::video},
                               std::pair{"actor", &TruthClip::actor},
                               std::pair{"camera", &TruthClip::camera},
                               std::pair{"joints", &TruthClip::joints},
                               std::pair{"vertices", &TruthClip::vertices},
                               std::pair{"masks", &TruthClip::masks},
                               std::pair{"detections2d", &TruthClip::detections2d},
                               std::pair{"detections3d", &TruthClip::detections3d}};

int PositiveInt(const JsonPlace& place) {
  const int value = place.Int();
  if (value < 1) place.Fail(fmt::format("is {}, expected at least 1", value));
  return value;
}

}  // namespace

TruthClip ReadTruthClip(const fs::path& path) {
  std::error_code ec;
  const fs::path file = fs::is_directory(path, ec) ? path / kFileName : path;
  const Json json = internal::ParseJson(ReadFile(file), file.string());
  const JsonPlace root(json, file.string());
  if (!root.Has("format") || root["format"].String() != kTruthFormat) {
    root.Fail(fmt::format("has no format \"{}\"", kTruthFormat));
  }
  if (root["version"].Int() != kTruthVersion) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{}: version {} of {}, only {} is supported", file.string(),
                            root["version"].Int(), kTruthFormat, kTruthVersion));
  }
  TruthClip clip;
  clip.fps = root["fps"].Number();
  if (clip.fps <= 0) root["fps"].Fail("is not a frame rate above 0");
  clip.num_frames = PositiveInt(root["frames"]);
  clip.width = PositiveInt(root["width"]);
  clip.height = PositiveInt(root["height"]);
  if (root.Has("floor")) {
    if (!json["floor"].is_boolean()) root["floor"].Fail("is neither true nor false");
    clip.has_floor = json["floor"].get<bool>();
  }
  if (root.Has("seed")) {
    if (!json["seed"].is_number_unsigned()) root["seed"].Fail("is no whole number from 0 on");
    clip.seed = json["seed"].get<std::uint64_t>();
  }
  for (const auto& [name, member] : kTexts) {
    if (root.Has(name)) clip.*member = root[name].String();
  }
  for (const auto& [name, member] : kFiles) {
    if (root.Has(name)) clip.*member = file.parent_path() / root[name].String();
  }
  return clip;
}

void WriteTruthClip(const fs::path& folder, const TruthClip& clip) {
  Json json = {{"format", kTruthFormat},    {"version", kTruthVersion}, {"fps", clip.fps},
               {"frames", clip.num_frames}, {"width", clip.width},      {"height", clip.height},
               {"floor", clip.has_floor},   {"seed", clip.seed}};
  for (const auto& [name, member] : kTexts) json[name] = clip.*member;
  for (const auto& [name, member] : kFiles) {
    const fs::path& path = clip.*member;
    if (!path.empty()) json[name] = path.lexically_proximate(folder).generic_string();
  }
  WriteFileAtomically(folder / kFileName,
                      json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace mpc
