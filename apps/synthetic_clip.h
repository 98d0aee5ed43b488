// Purpose: the clip folder of `monoperfcap synth` (docs/formats.md, "Synthetic clips").
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "mpc/eval/dressed_actor.h"
#include "mpc/eval/synthetic_performance.h"

namespace monoperfcap {

struct SyntheticClipRequest {
  std::filesystem::path output;
  std::filesystem::path actor;                // empty: the program's own
  mpc::Outfit outfit = mpc::Outfit::kCasual;  // of the program's own actor
  std::string motion = "walk";                // a name, or the path of a BVH file
  double start_s = 0;                         // where a BVH file is cut
  double seconds = 3;
  double fps = 30;
  mpc::PerformanceOptions options;
  int num_threads = 0;
  bool quiet = false;
};

// Whether a motion is the path of a BVH file rather than a name.
bool IsBvhPath(const std::string& motion);

// Makes and writes everything, truth.json last. Returns false when the user interrupted the pictures;
// throws mpc::Error: kCancelled when before them. `summary` gets a line of text about the clip.
bool WriteSyntheticClip(const SyntheticClipRequest& request, std::string* summary);

}  // namespace monoperfcap
