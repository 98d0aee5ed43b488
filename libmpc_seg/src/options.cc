#include <fmt/format.h>

#include <string>

#include "mpc/core/error.h"
#include "mpc/seg/silhouette.h"

namespace mpc {

SegmentationOptions SegmentationOptions::Paper() {
  SegmentationOptions options;
  options.clip_skeleton = false;
  options.gamma_motion = 25;
  options.weight_shape = 0;
  options.weight_still = 0;
  options.weight_measured = 0;
  options.outline_discount = 0;
  options.weight_plate = 0;
  options.num_components = 5;
  options.colour_reach = 0;
  options.num_rounds = 5;
  options.band_colours = false;
  options.max_cut_size_px = 0;
  options.eight_connected = true;
  options.look_ahead = false;
  options.keep_earlier = false;
  options.clean = false;
  return options;
}

SegmentationOptions SegmentationOptions::AfterRefinement() {
  SegmentationOptions options;
  options.erode /= 2;
  options.dilate /= 2;
  options.gamma /= 2;
  options.gamma_motion /= 2;
  return options;
}

void SegmentationOptions::Validate() const {
  std::string faults;
  // Also false for a value that is not a number.
  const auto check = [&faults](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    faults += fmt::format("{}{} is {}, expected {} to {}", faults.empty() ? "" : "; ", name, value,
                          low, high);
  };
  check("erode", erode, 0, 1);
  check("dilate", dilate, 0.001, 1);
  check("gamma", gamma, 0, 1e4);
  check("gamma_motion", gamma_motion, 0, gamma / 2);
  check("weight_shape", weight_shape, 0, 1e3);
  check("weight_still", weight_still, 0, 1e3);
  check("weight_measured", weight_measured, 0, 1e3);
  check("outline_discount", outline_discount, 0, 1);
  check("weight_plate", weight_plate, 0, 1e3);
  check("weight_person", weight_person, 0, 1e3);
  check("colour_reach", colour_reach, 0, 10);
  if (max_cut_size_px != 0) check("max_cut_size_px", max_cut_size_px, 10, 1e6);
  check("num_components", num_components, 1, 16);
  check("num_rounds", num_rounds, 1, 100);
  if (!faults.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "segmentation options: " + faults);
  }
}

const char* SilhouetteStateName(SilhouetteState state) {
  switch (state) {
    case SilhouetteState::kCut:
      return "cut";
    case SilhouetteState::kAmbiguous:
      return "ambiguous";
    case SilhouetteState::kNoBackground:
      return "no background";
    case SilhouetteState::kNoModel:
      return "no model";
    case SilhouetteState::kExternal:
      return "external";
  }
  return "";
}

}  // namespace mpc
