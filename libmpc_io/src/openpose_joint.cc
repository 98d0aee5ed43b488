#include "openpose_joint.h"

#include <map>

namespace mpc::internal {

std::optional<JointId> OpenPoseJoint(std::string_view name) {
  static const std::map<std::string_view, JointId> kJoints = {
      {"Nose", JointId::kNose},
      {"LEye", JointId::kLeftEye},
      {"REye", JointId::kRightEye},
      {"LEar", JointId::kLeftEar},
      {"REar", JointId::kRightEar},
      {"LShoulder", JointId::kLeftShoulder},
      {"RShoulder", JointId::kRightShoulder},
      {"LElbow", JointId::kLeftElbow},
      {"RElbow", JointId::kRightElbow},
      {"LWrist", JointId::kLeftWrist},
      {"RWrist", JointId::kRightWrist},
      {"LHip", JointId::kLeftHip},
      {"RHip", JointId::kRightHip},
      {"LKnee", JointId::kLeftKnee},
      {"RKnee", JointId::kRightKnee},
      {"LAnkle", JointId::kLeftAnkle},
      {"RAnkle", JointId::kRightAnkle},
      {"Neck", JointId::kNeck},
      {"Head", JointId::kHeadTop},  // BODY_25B's head is the top of the skull
      {"MidHip", JointId::kPelvis},
      {"LBigToe", JointId::kLeftToe},
      {"RBigToe", JointId::kRightToe},
      {"LSmallToe", JointId::kLeftSmallToe},
      {"RSmallToe", JointId::kRightSmallToe},
      {"LHeel", JointId::kLeftHeel},
      {"RHeel", JointId::kRightHeel},
  };
  const auto it = kJoints.find(name);
  return it == kJoints.end() ? std::nullopt : std::optional(it->second);
}

}  // namespace mpc::internal
