// Purpose: what a joint detector saw in a clip, in 2D and in 3D.
// Source: d2d and d3d of the paper, Section 4, "Discriminative Joint Alignment Terms".
// Units: 2D in pixels of the video as stored, 3D in metres. Symbols: J joints, F frames.
//
// A joint that was not seen has confidence 0 and any (finite) position.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/joints.h"

namespace mpc {

struct Detections2d {
  struct Frame {
    Eigen::Matrix2Xd pixels;     // 2xJ
    Eigen::VectorXd confidence;  // J, in [0, 1]
  };
  int width = 0;  // of the picture the pixels refer to; 0 if the source does not say
  int height = 0;
  std::vector<JointId> joints;  // J, each at most once
  std::vector<Frame> frames;    // F

  // Throws Error (kInvalidArgument) for wrong sizes, non-finite values, repeated joints.
  void Validate() const;
};

struct Detections3d {
  struct Frame {
    Eigen::Matrix3Xd positions;  // 3xJ, root-relative: any common offset; x right, y down, z away
    Eigen::VectorXd confidence;  // J, in [0, 1]
  };
  std::vector<JointId> joints;
  std::vector<Frame> frames;
  // True when the axes follow the viewing ray through the hips (networks that look at a crop around
  // them), false when they are the camera's own.
  bool ray_aligned = false;

  void Validate() const;
};

// Column of a joint in `joints`, or -1.
int FindColumn(const std::vector<JointId>& joints, JointId joint);

}  // namespace mpc
