#include "mpc/detect/models.h"

#include <fmt/format.h>

#include <cstdlib>
#include <string>

#include "mpc/core/error.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

std::string Environment(const char* name) {
  const char* const value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe)
  return value == nullptr ? "" : value;
}

fs::path FindModel(const fs::path& folder, const char* name) {
  for (const char* const extension : {".tflite", ".onnx"}) {
    std::error_code ec;
    const fs::path path = folder / (std::string(name) + extension);
    if (fs::exists(path, ec)) return path;
  }
  throw Error(ErrorCode::kFileNotFound,
              fmt::format("{} has no {}.tflite: run scripts/get_models.sh, which fetches the "
                          "networks, or name their folder in MPC_MODELS",
                          folder.string(), name));
}

}  // namespace

fs::path DefaultModelFolder() {
  if (const std::string folder = Environment("MPC_MODELS"); !folder.empty()) return folder;
  const std::string cache = Environment("XDG_CACHE_HOME");
  return (cache.empty() ? fs::path(Environment("HOME")) / ".cache" : fs::path(cache)) / "mpc" /
         "models";
}

PoseModels FindPoseModels(fs::path folder) {
  if (folder.empty()) folder = DefaultModelFolder();
  return {.detector = FindModel(folder, "pose_detection"),
          .landmarker = FindModel(folder, "pose_landmark_heavy")};
}

}  // namespace mpc
