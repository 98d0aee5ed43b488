#include "mpc/core/progress.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>

namespace mpc {
namespace {

std::string TimeLeft(double seconds) {
  const auto total = static_cast<std::int64_t>(std::ceil(seconds));
  if (total < 60) return fmt::format("{} s left", total);
  if (total < 3600) return fmt::format("{} min {} s left", total / 60, total % 60);
  return fmt::format("{} h {} min left", total / 3600, total % 3600 / 60);
}

}  // namespace

std::string ProgressFormatter::Line(const Progress& progress, Clock::time_point now) {
  if (progress.stage != stage_ || progress.step < first_step_) {
    stage_ = progress.stage;
    stage_start_ = now;
    first_step_ = progress.step;
  }
  if (progress.num_steps <= 0) return stage_;
  const std::int64_t percent = std::int64_t{100} * progress.step / progress.num_steps;
  std::string line =
      fmt::format("{} {}/{} ({} %)", stage_, progress.step, progress.num_steps, percent);
  const int finished = progress.step - first_step_;
  const int remaining = progress.num_steps - progress.step;
  if (finished > 0 && remaining > 0) {
    const double elapsed = std::chrono::duration<double>(now - stage_start_).count();
    line += ", " + TimeLeft(elapsed / finished * remaining);
  }
  return line;
}

}  // namespace mpc
