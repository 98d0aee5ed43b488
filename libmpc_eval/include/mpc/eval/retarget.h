// Purpose: the motion of somebody else's skeleton, performed by ours.
// Source: ours. Limb directions are matched frame by frame by a bounded Gauss-Newton fit on the
// analytic Jacobian, started from the previous frame.
// Frames: source and result y up. Units: any length for the source, metres for the result.
// Symbols: J source joints, F frames, N dofs of our skeleton.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "mpc/skeleton/skeleton.h"

namespace mpc {

// A motion-capture clip as plain data, such as a BVH file gives. End sites count as joints (any
// name): toe tips and the head top are the far ends of their chains.
struct SourceMotion {
  std::vector<std::string> names;                 // J
  std::vector<int> parents;                       // J, an earlier joint or -1
  std::vector<Eigen::Matrix3Xd> joint_positions;  // F times 3xJ, y up, any unit of length
  double fps = 0;

  // Throws Error (kInvalidArgument) naming every fault: sizes, parents, non-finite positions, fps.
  void Validate() const;
};

struct RetargetSummary {
  double mean_direction_error_rad = 0;  // angle between the source's limbs and ours
  double max_direction_error_rad = 0;   // largest mean over a frame's limbs
  double scale = 0;                     // metres of ours per unit of the source (leg lengths)
};

// Poses N x F at the source's frame rate: limb directions of the source, root path scaled by leg
// length, hinge bounds kept, the feet on the floor y = 0 whenever the source's are. Twists that
// positions do not show stay near rest. Joints are recognised by name: CMU, Mixamo, DeepMimic, VRM,
// plain ("left_hip") spellings, and the segments of our own BVH files. Throws Error (kUnsupported) listing the joints not found and
// the names that were there. About 0.3 ms per frame.
Eigen::MatrixXd Retarget(const Skeleton& skeleton, const SourceMotion& source,
                         RetargetSummary* summary = nullptr);

}  // namespace mpc
