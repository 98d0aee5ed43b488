// Purpose: where the real data for tests labelled `data` lies.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

namespace mpc::testing {

// MPC_DATA, or the default beside the checkout; empty when the folder does not exist.
inline std::optional<std::filesystem::path> DataDir() {
  const char* env = std::getenv("MPC_DATA");
  const std::filesystem::path dir = env != nullptr ? env : MPC_DEFAULT_DATA_DIR;
  if (std::filesystem::is_directory(dir)) return dir;
  return std::nullopt;
}

}  // namespace mpc::testing

// First line of a data test: skips loudly, with the reason, when the data is not there.
#define MPC_REQUIRE_DATA()                                \
  if (!mpc::testing::DataDir())                           \
  GTEST_SKIP() << "needs the real data: set MPC_DATA to " \
                  "its folder (see docs/results.md)"
