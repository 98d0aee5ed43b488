// Purpose: poses.json: the poses of a capture and all that is needed to pose the actor again
// (docs/formats.md, "Poses").
// Frames: poses in the camera frame. Units: metres, radians, seconds.
// Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/skeleton/proportions.h"

namespace mpc {

struct CapturedPoses {
  std::filesystem::path video;  // absolute
  double image_fps = 0;         // of a folder of pictures; 0: a video
  std::filesystem::path actor;  // absolute
  double height_m = 0;          // the actor was first scaled to this height; 0: as in the file
  Proportions proportions;      // then to these
  double fps = 0;
  Camera camera;                  // for the video's resolution
  std::vector<std::string> dofs;  // N names: root, then hinges
  Eigen::MatrixXd poses;          // N x F
};

// Both throw Error: kFileNotFound, kBadFile (naming the place) and kWriteFailed. Numbers are written
// so that reading gives the same bits.
CapturedPoses ReadPoses(const std::filesystem::path& path);
void WritePoses(const std::filesystem::path& path, const CapturedPoses& captured);

}  // namespace mpc
