// Purpose: the undecided pixels of a trimap, row by row, past the many others eight at a time.
#pragma once

#include <cstdint>
#include <cstring>

#include "mpc/seg/trimap.h"

namespace mpc {

// The first unknown pixel of a row at or after x, or `width`.
inline int NextUnknown(const uint8_t* trimap, int x, int width) {
  constexpr uint64_t kUnknownBits = 0x0202020202020202;  // set in the labels of unknown pixels only
  uint64_t eight = 0;
  for (; x + 8 <= width; x += 8) {
    std::memcpy(&eight, trimap + x, sizeof eight);
    if ((eight & kUnknownBits) != 0) break;
  }
  while (x < width && !IsUnknown(trimap[x])) ++x;
  return x;
}

// Calls use(x) for them from left to right.
template <typename Use>
void ForEachUnknown(const uint8_t* trimap, int width, const Use& use) {
  for (int x = NextUnknown(trimap, 0, width); x < width; x = NextUnknown(trimap, x + 1, width)) {
    use(x);
  }
}

}  // namespace mpc
