// Purpose: a BVH file as the plain motion that retargeting takes; end sites become joints.
#pragma once

#include "mpc/eval/retarget.h"
#include "mpc/io/bvh.h"

namespace mpc::testing {

inline SourceMotion SourceFromBvh(const BvhMotion& motion) {
  const BvhJointPaths paths = JointPathsOf(motion, 0, motion.num_frames());
  return {paths.names, paths.parents, paths.positions, 1 / motion.frame_time_s};
}

}  // namespace mpc::testing
