// Purpose: how long work reports where it is and is asked to stop.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <string_view>

namespace mpc {

struct Progress {
  std::string_view stage;  // such as "pose"
  int step = 0;            // steps finished, 0 <= step <= num_steps
  int num_steps = 0;
};

// Returns false to ask the work to stop; the work then ends early with a usable partial result.
// Called from the thread that started the work, never concurrently.
using ProgressCallback = std::function<bool(const Progress&)>;

// Turns progress into lines of text for people: stage, percent, steps, and time left.
// Estimates from the steps of the current stage. Not thread-safe.
class ProgressFormatter {
 public:
  using Clock = std::chrono::steady_clock;

  // A line such as "pose 40/100 (40 %), 3 s left"; `now` is a parameter so that it can be tested.
  std::string Line(const Progress& progress, Clock::time_point now = Clock::now());

 private:
  std::string stage_;
  Clock::time_point stage_start_;
  int first_step_ = 0;  // of the stage, when it was first seen
};

}  // namespace mpc
