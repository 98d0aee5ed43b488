#include "mpc/skeleton/rig_pose.h"

namespace mpc {

void RigBoneTransforms(const RigAsset& rig, const Character& character, const KinematicState& state,
                       std::vector<Eigen::Affine3d>* body_from_bone) {
  body_from_bone->resize(rig.bones.size());
  for (size_t b = 0; b < rig.bones.size(); ++b) {
    const int s = character.bone_segment[b];
    Eigen::Affine3d body_from_scene = Eigen::Affine3d::Identity();
    body_from_scene.linear() = state.rotations[s] * character.bind.rotations[s].transpose();
    body_from_scene.translation() =
        state.origins.col(s) - body_from_scene.linear() * character.bind.origins.col(s);
    (*body_from_bone)[b] = body_from_scene * rig.bones[b].scene_from_bone;
  }
}

}  // namespace mpc
