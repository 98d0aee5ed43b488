// Purpose: a BVH file as the plain motion that retargeting takes; end sites become joints.
#pragma once

#include <cmath>

#include "mpc/eval/retarget.h"
#include "mpc/io/bvh.h"

namespace mpc::testing {

inline SourceMotion SourceFromBvh(const BvhMotion& motion) {
  SourceMotion source;
  source.fps = 1 / motion.frame_time_s;
  for (const BvhJoint& joint : motion.joints) {
    source.names.push_back(joint.name);
    source.parents.push_back(joint.parent);
  }
  const size_t num_joints = motion.joints.size();
  for (size_t j = 0; j < num_joints; ++j) {
    if (!motion.joints[j].end_site) continue;
    source.names.push_back(motion.joints[j].name + "_end");
    source.parents.push_back(static_cast<int>(j));
  }
  for (int f = 0; f < motion.num_frames(); ++f) {
    const std::vector<Eigen::Isometry3d> world_from_joint = BvhJointTransforms(motion, f);
    Eigen::Matrix3Xd positions(3, static_cast<Eigen::Index>(source.names.size()));
    Eigen::Index end = static_cast<Eigen::Index>(num_joints);
    for (size_t j = 0; j < num_joints; ++j) {
      positions.col(static_cast<Eigen::Index>(j)) = world_from_joint[j].translation();
      if (motion.joints[j].end_site) {
        positions.col(end++) = world_from_joint[j] * *motion.joints[j].end_site;
      }
    }
    source.joint_positions.push_back(positions);
  }
  return source;
}

}  // namespace mpc::testing
