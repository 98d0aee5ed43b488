// Purpose: the undecided pixels of a trimap, row by row, past the many others eight at a time.
#pragma once

#include <cstdint>

#include "mpc/seg/trimap.h"
#include "pixel_block.h"

namespace mpc {

// The first unknown pixel of a row at or after x, or `width`.
inline int NextUnknown(const uint8_t* trimap, int x, int width) {
  constexpr uint64_t kUnknownBits = 0x0202020202020202;  // set in the labels of unknown pixels only
  while (x + kBlock <= width && (Block(trimap + x) & kUnknownBits) == 0) x += kBlock;
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
