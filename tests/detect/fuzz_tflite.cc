// libFuzzer target: any bytes as a TensorFlow Lite network end in a network or in mpc::Error.
//
//   cmake --preset fuzz && cmake --build --preset fuzz
//   build/fuzz/tests/detect/fuzz_tflite -max_total_time=600 CORPUS
#include <cstddef>
#include <cstdint>

#include "mpc/core/error.h"
#include "mpc/detect/network.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    static_cast<void>(mpc::Network::FromTflite({data, size}, "fuzz"));
  } catch (const mpc::Error&) {
  }
  return 0;
}
