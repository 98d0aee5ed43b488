// Purpose: the options of the person detector, for the commands that run it.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "mpc/detect/clip_detector.h"

namespace monoperfcap {

struct DetectArguments {
  std::string models;
  std::string every = "auto";
  int person = 1;
  std::vector<double> at;  // x, y, or empty
  bool mirror = false;

  void AddTo(CLI::App* app);
  mpc::ClipDetectorOptions Options() const;
};

}  // namespace monoperfcap
