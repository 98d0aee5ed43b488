// Purpose: reads the TensorFlow Lite networks of MediaPipe's pose solution.
// Source: TensorFlow Lite schema, version 3 ("TFL3"); of its operations those in docs/detect.md.
//
// Weights may be float, half float, or sparse along their last axis (DENSIFY).
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "graph.h"

namespace mpc::internal {

bool IsTflite(std::span<const std::uint8_t> bytes);

// `name` stands in messages. Any bytes at all either give a graph that can be run or throw Error:
// kBadFile with the place, kUnsupported for what the subset lacks. Memory stays below a fixed
// multiple of the bytes.
Graph ReadTflite(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace mpc::internal
