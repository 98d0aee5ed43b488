// Purpose: pixels of a row eight at a time, to pass over what is alike.
#pragma once

#include <cstdint>
#include <cstring>

namespace mpc {

constexpr int kBlock = 8;  // pixels that are looked at together

inline uint64_t Block(const uint8_t* pixels) {
  uint64_t block;
  std::memcpy(&block, pixels, kBlock);
  return block;
}

}  // namespace mpc
