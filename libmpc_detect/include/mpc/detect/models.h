// Purpose: where the networks' files are, and what to do when they are not there.
#pragma once

#include <filesystem>

namespace mpc {

struct PoseModels {
  std::filesystem::path detector;    // pose_detection.tflite or .onnx
  std::filesystem::path landmarker;  // pose_landmark_heavy.tflite or .onnx
};

// Where scripts/get_models.sh puts them: $MPC_MODELS, else $XDG_CACHE_HOME/mpc/models, else
// ~/.cache/mpc/models. Reads the environment.
std::filesystem::path DefaultModelFolder();

// The two files in `folder` (empty: the default). Throws Error (kFileNotFound) that names what is
// missing and the command that fetches it. Nothing is downloaded.
PoseModels FindPoseModels(std::filesystem::path folder = {});

}  // namespace mpc
