// Purpose: marker and joint trajectories as TRC, the text format of OpenSim and Cortex.
// Source: OpenSim documentation, "Marker (.trc) Files".
// Frames: whatever world the caller uses. Units: metres. Symbols: M markers, F frames.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace mpc {

struct MarkerTrajectories {
  std::vector<std::string> names;  // M, without tabs
  double fps = 0;
  Eigen::MatrixXd positions;  // 3MxF, marker m in rows 3m..3m+2; NaN where it is missing

  int num_frames() const { return static_cast<int>(positions.cols()); }
};

// Accepts the units m, cm and mm. Throws Error: kFileNotFound; kBadFile with the line and what was
// expected there.
MarkerTrajectories ReadTrc(const std::filesystem::path& path);

// Writes metres with 6 decimals; a missing marker leaves its three fields empty. Throws Error:
// kInvalidArgument (sizes, fps, names), kWriteFailed.
void WriteTrc(const std::filesystem::path& path, const MarkerTrajectories& trajectories);

}  // namespace mpc
