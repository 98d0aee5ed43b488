// Purpose: the joint vocabulary shared by detectors, skeletons, files and metrics.
// Source: 16 joints of the paper (Section 4); extra surface points as in BODY_25 and BlazePose.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace mpc {

// The paper's 16 joints come first, in this order; the others are optional extra points.
enum class JointId {
  kHeadTop,
  kNeck,
  kLeftShoulder,
  kRightShoulder,
  kLeftElbow,
  kRightElbow,
  kLeftWrist,
  kRightWrist,
  kLeftHip,
  kRightHip,
  kLeftKnee,
  kRightKnee,
  kLeftAnkle,
  kRightAnkle,
  kLeftToe,  // tip of the big toe
  kRightToe,
  // Extra points.
  kPelvis,  // midway between the hips
  kLeftHeel,
  kRightHeel,
  kLeftSmallToe,
  kRightSmallToe,
  kNose,
  kLeftEye,
  kRightEye,
  kLeftEar,
  kRightEar,
};
inline constexpr int kNumPaperJoints = 16;
inline constexpr int kNumJointIds = 26;

// File name of a joint, such as "left_elbow" ("head_top", "neck", "pelvis").
std::string_view JointName(JointId joint);

// Inverse of JointName; empty for an unknown name.
std::optional<JointId> FindJoint(std::string_view name);

// The same joint of the other side; a joint on the middle line is its own mirror.
JointId MirrorJoint(JointId joint);

// Joint scored by the papers' metrics on real data: shoulders, elbows, wrists, hips, knees, ankles,
// big toes (14).
std::span<const JointId> ScoredJoints14();

// Lines of a stick figure over the 16 joints, for drawing.
struct JointPair {
  JointId a;
  JointId b;
};
std::span<const JointPair> StickFigure();

}  // namespace mpc
