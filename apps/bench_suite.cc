#include "bench_suite.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <system_error>

#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/gltf.h"
#include "mpc/io/truth_file.h"
#include "mpc/io/video.h"
#include "mpc/skeleton/rig_map.h"

namespace monoperfcap {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Frozen before the surface stage was built: results of different versions can be compared.
const std::vector<SyntheticSpec>& FullSuite() {
  static const std::vector<SyntheticSpec> kSuite = {
      {"walk_casual", "walk", "casual", "static", 11, 4, 30, 640, 480},
      {"walk_skirt_pan", "walk", "skirt", "pan", 12, 4, 25, 640, 480},
      {"turn_coat", "turn", "coat", "static", 13, 4, 30, 480, 640},
      {"turn_skirt", "turn", "skirt", "static", 14, 3, 30, 640, 640},
      {"jump_tight", "jump", "tight", "static", 15, 2.5, 60, 640, 480},
      {"jump_coat_handheld", "jump", "coat", "handheld", 16, 3, 30, 640, 480},
      {"kick_casual", "kick", "casual", "static", 17, 3, 50, 640, 480},
      {"sit_casual", "sit", "casual", "static", 18, 4, 24, 480, 640},
      {"squat_tight", "squat", "tight", "static", 19, 3, 30, 480, 480},
      {"wave_coat", "wave", "coat", "static", 20, 4, 25, 480, 640},
      {"bend_skirt_handheld", "bend", "skirt", "handheld", 21, 4, 30, 640, 480},
      {"reach_tight_hd", "reach", "tight", "static", 22, 2, 30, 1280, 720},
  };
  return kSuite;
}

// Seconds each, so that every push can afford them.
const std::vector<SyntheticSpec>& SmallSuite() {
  static const std::vector<SyntheticSpec> kSuite = {
      {"walk", "walk", "casual", "static", 1, 2, 25, 320, 240},
      {"turn", "turn", "skirt", "static", 2, 2, 25, 240, 320},
      {"squat", "squat", "tight", "static", 3, 2, 25, 240, 240},
  };
  return kSuite;
}

SyntheticSpec ParseSpec(const nlohmann::json& json) {
  SyntheticSpec spec;
  spec.name = json.at("name").get<std::string>();
  spec.motion = json.at("motion").get<std::string>();
  spec.outfit = json.value("outfit", "casual");
  spec.camera = json.value("camera", "static");
  spec.seed = json.value("seed", spec.seed);
  spec.seconds = json.value("seconds", spec.seconds);
  spec.fps = json.value("fps", spec.fps);
  spec.width = json.value("width", spec.width);
  spec.height = json.value("height", spec.height);
  spec.noise = json.value("noise", spec.noise);
  return spec;
}

// A name becomes a folder's name.
void RequireGoodNames(const std::vector<SyntheticSpec>& specs, const std::string& source) {
  constexpr const char* kLetters =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
  std::set<std::string> names;
  for (const SyntheticSpec& spec : specs) {
    if (spec.name.empty() || spec.name.find_first_not_of(kLetters) != std::string::npos) {
      throw mpc::Error(
          mpc::ErrorCode::kBadFile,
          fmt::format("{}: \"{}\" is no name of letters, digits, _ and -", source, spec.name));
    }
    if (!names.insert(spec.name).second) {
      throw mpc::Error(mpc::ErrorCode::kBadFile,
                       fmt::format("{}: two clips are called {}", source, spec.name));
    }
  }
}

BenchClip LoadActor(const std::string& name, const fs::path& actor) {
  BenchClip clip;
  clip.name = name;
  clip.rig = mpc::ReadRigGltf(actor);
  clip.character = mpc::BuildCharacter(clip.rig, mpc::MapRigByNames(clip.rig));
  return clip;
}

void LoadDetections(const fs::path& detections2d, const fs::path& detections3d, BenchClip* clip) {
  clip->detections2d = mpc::ReadDetections2d(detections2d);
  clip->detections3d = mpc::ReadDetections3d(detections3d);
  const mpc::VideoReader video(clip->video);
  clip->fps = video.fps();
  clip->camera = clip->camera.ScaledTo(video.width(), video.height());
}

}  // namespace

std::vector<SyntheticSpec> ReadSuite(const std::string& name) {
  if (name == "full") return FullSuite();
  if (name == "small") return SmallSuite();
  std::vector<SyntheticSpec> specs;
  const std::string text = mpc::ReadFile(name);
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    if (json.at("format") != "mpc-suite" || json.at("version") != 1) {
      throw mpc::Error(mpc::ErrorCode::kBadFile, name + " is no mpc-suite of version 1");
    }
    for (const nlohmann::json& clip : json.at("clips")) specs.push_back(ParseSpec(clip));
  } catch (const nlohmann::json::exception& e) {
    throw mpc::Error(mpc::ErrorCode::kBadFile, fmt::format("{}: {}", name, e.what()));
  }
  RequireGoodNames(specs, name);
  return specs;
}

Json SpecJson(const SyntheticSpec& spec) {
  return {{"name", spec.name},     {"motion", spec.motion}, {"outfit", spec.outfit},
          {"camera", spec.camera}, {"seed", spec.seed},     {"seconds", spec.seconds},
          {"fps", spec.fps},       {"width", spec.width},   {"height", spec.height},
          {"noise", spec.noise}};
}

BenchClip ReadSyntheticClip(const std::string& name, const fs::path& folder) {
  const mpc::TruthClip files = mpc::ReadTruthClip(folder);
  BenchClip clip = LoadActor(name, files.actor);
  clip.video = files.video;
  clip.truth = ReadTruth(folder);
  clip.camera = *clip.truth.camera;
  LoadDetections(files.detections2d, files.detections3d, &clip);
  return clip;
}

std::vector<std::string> RealClips(const fs::path& data) {
  std::vector<std::string> names;
  std::error_code ec;
  for (const char* camera : {"cam01", "cam03"}) {
    if (fs::exists(data / "pose2sim" / fmt::format("{}.mp4", camera), ec)) {
      names.emplace_back(camera);
    }
  }
  return names;
}

BenchClip ReadRealClip(const std::string& name, const fs::path& data) {
  const fs::path folder = data / "pose2sim";
  BenchClip clip = LoadActor(name, data / "actors" / "male_tpose.glb");
  clip.video = folder / (name + ".mp4");
  clip.truth = ReadTruth(folder / "gt_joints.json", folder / "masks" / name);
  clip.camera = mpc::ReadCamera((folder / "cameras.json").string() + ":" + name);
  LoadDetections(folder / (name + "_openpose_body25b.json"), folder / (name + "_blazepose.json"),
                 &clip);
  return clip;
}

}  // namespace monoperfcap
