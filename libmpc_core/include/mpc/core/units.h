// Factors between units, and the value of what was not measured.
#pragma once

#include <limits>
#include <numbers>

namespace mpc {

inline constexpr double kDegree = std::numbers::pi / 180;  // in radians
inline constexpr double kMmPerMetre = 1e3;
inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace mpc
