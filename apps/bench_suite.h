// Purpose: which clips the benchmark runs on: synthetic ones, described by their numbers and frozen,
// and the real ones with truth where the data is at hand.
// Units: seconds, pixels.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "evaluation.h"
#include "mpc/core/detections.h"
#include "mpc/skeleton/rig_asset.h"

namespace monoperfcap {

// A synthetic clip, as `monoperfcap synth` makes it from these numbers.
struct SyntheticSpec {
  std::string name;
  std::string motion;
  std::string outfit;
  std::string camera;  // its motion
  std::uint64_t seed = 1;
  double seconds = 3;
  double fps = 30;
  int width = 640;
  int height = 480;
  std::string noise = "measured";
};

// "full", "small", or a file: {"format": "mpc-suite", "version": 1, "clips": [...]}. Throws mpc::Error.
std::vector<SyntheticSpec> ReadSuite(const std::string& name);

nlohmann::ordered_json SpecJson(const SyntheticSpec& spec);

// Everything that the stages and their evaluation need of a clip.
struct BenchClip {
  std::string name;
  std::filesystem::path video;
  mpc::RigAsset rig;
  mpc::Character character;
  mpc::Camera camera;
  mpc::Detections2d detections2d;
  mpc::Detections3d detections3d;
  double fps = 0;
  Truth truth;

  int num_frames() const { return static_cast<int>(detections2d.frames.size()); }
};

// Reads the folder of a synthetic clip. Throws mpc::Error.
BenchClip ReadSyntheticClip(const std::string& name, const std::filesystem::path& folder);

// The real clips in a data folder (docs/results.md, "Data"): their names; empty without the data.
std::vector<std::string> RealClips(const std::filesystem::path& data);
BenchClip ReadRealClip(const std::string& name, const std::filesystem::path& data);

}  // namespace monoperfcap
