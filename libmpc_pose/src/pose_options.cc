#include "mpc/pose/pose_options.h"

#include <fmt/format.h>

#include <string>

#include "mpc/core/error.h"

namespace mpc {

PoseOptions PoseOptions::Paper() {
  PoseOptions options;
  options.window_frames = 50;
  options.overlap_frames = 10;
  options.basis_size = 8;
  options.weight_smooth = 50;
  options.soft_band = false;
  options.adaptive_band = false;
  options.repair_detections = false;
  options.anisotropic_3d = false;
  options.pixels_in_mm = false;
  options.confidence_weights = false;
  options.error_2d_mm = 20;
  options.robust_2d = 0;
  options.robust_3d = 0;
  options.test_depth_flips = false;
  options.hold_standing_feet = false;
  options.lasting_discount = 1;
  options.weight_rest = 0;
  options.robust_rest = 0;
  options.fit_proportions = false;
  return options;
}

void PoseOptions::Validate() const {
  std::string faults;
  const auto require = [&faults](bool ok, const std::string& text) {
    if (!ok) faults += (faults.empty() ? "" : "; ") + text;
  };
  const auto non_negative = [&require](double value, const char* name) {
    require(value >= 0 && value < 1e12, fmt::format("{} is {}, not a number >= 0", name, value));
  };
  require(window_frames >= 2 && window_frames <= 1000,
          fmt::format("window_frames is {}, not in [2, 1000]", window_frames));
  require(overlap_frames >= 1 && overlap_frames <= window_frames / 2,
          fmt::format("overlap_frames is {}, not in [1, window_frames / 2]", overlap_frames));
  require(basis_size >= 0, fmt::format("basis_size is {}, not >= 0", basis_size));
  require(cutoff_hz > 0 && cutoff_hz <= 1000,
          fmt::format("cutoff_hz is {}, not in (0, 1000]", cutoff_hz));
  require(weight_smooth > 0 && weight_smooth < 1e12,
          fmt::format("weight_smooth is {}, not > 0", weight_smooth));
  non_negative(lambda_translation, "lambda_translation");
  non_negative(lambda_rotation, "lambda_rotation");
  non_negative(lambda_angles, "lambda_angles");
  non_negative(weight_3d, "weight_3d");
  non_negative(error_2d_mm, "error_2d_mm");
  non_negative(error_3d_mm, "error_3d_mm");
  require(depth_error_ratio > 0 && depth_error_ratio < 1e6,
          fmt::format("depth_error_ratio is {}, not > 0", depth_error_ratio));
  non_negative(robust_2d, "robust_2d");
  non_negative(robust_3d, "robust_3d");
  non_negative(pck_threshold, "pck_threshold");
  require(lasting_discount >= 1 && lasting_discount <= 100,
          fmt::format("lasting_discount is {}, not in [1, 100]", lasting_discount));
  non_negative(weight_rest, "weight_rest");
  non_negative(robust_rest, "robust_rest");
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "invalid pose options: " + faults);
}

}  // namespace mpc
