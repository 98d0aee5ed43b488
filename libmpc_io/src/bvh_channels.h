// The names of a joint's channels as BVH writes them.
#pragma once

#include <array>
#include <string_view>

namespace mpc {

inline constexpr std::array<std::string_view, 6> kChannelNames = {
    "Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation"};

}  // namespace mpc
