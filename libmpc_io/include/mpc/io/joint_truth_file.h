// Purpose: read joint trajectories to compare with: our own joints.trc, or a ground-truth file.
// Frames: the file's own world. Units: metres. Symbols: J joints, F frames.
//
// The kind of file is found from its content:
//   TRC               markers named as JointName says; others are left out
//   ground truth      {"fps": .., "names": [..], "joints": F x [x, y, z] or nulls per name}, with
//                     BODY_25 names ("LShoulder", "Head", "RBigToe"); others are left out
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "mpc/core/joints.h"

namespace mpc {

struct JointTrack {
  std::vector<JointId> joints;  // J, each once
  double fps = 0;
  Eigen::MatrixXd positions;  // 3J x F, joint i in rows 3i..3i+2; NaN where it is missing

  int num_frames() const { return static_cast<int>(positions.cols()); }
};

// Throws Error: kFileNotFound; kBadFile naming file and place, also for a file without any known
// joint.
JointTrack ReadJointTrack(const std::filesystem::path& path);

}  // namespace mpc
