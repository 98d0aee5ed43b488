#include "mpc/core/joints.h"

#include <array>

namespace mpc {
namespace {

using enum JointId;

constexpr std::array<std::string_view, kNumJointIds> kNames = {
    "head_top",        "neck",       "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow",     "left_wrist", "right_wrist",   "left_hip",       "right_hip",
    "left_knee",       "right_knee", "left_ankle",    "right_ankle",    "left_toe",
    "right_toe",       "pelvis",     "left_heel",     "right_heel",     "left_small_toe",
    "right_small_toe", "nose",       "left_eye",      "right_eye",      "left_ear",
    "right_ear"};

constexpr std::array<JointId, 14> kScored14 = {
    kLeftShoulder, kRightShoulder, kLeftElbow, kRightElbow, kLeftWrist,  kRightWrist, kLeftHip,
    kRightHip,     kLeftKnee,      kRightKnee, kLeftAnkle,  kRightAnkle, kLeftToe,    kRightToe};

constexpr std::array<JointPair, 17> kStickFigure = {{{kHeadTop, kNeck},
                                                     {kNeck, kLeftShoulder},
                                                     {kNeck, kRightShoulder},
                                                     {kLeftShoulder, kLeftElbow},
                                                     {kRightShoulder, kRightElbow},
                                                     {kLeftElbow, kLeftWrist},
                                                     {kRightElbow, kRightWrist},
                                                     {kLeftShoulder, kLeftHip},
                                                     {kRightShoulder, kRightHip},
                                                     {kLeftHip, kRightHip},
                                                     {kLeftHip, kLeftKnee},
                                                     {kRightHip, kRightKnee},
                                                     {kLeftKnee, kLeftAnkle},
                                                     {kRightKnee, kRightAnkle},
                                                     {kLeftAnkle, kLeftToe},
                                                     {kRightAnkle, kRightToe},
                                                     {kLeftShoulder, kRightShoulder}}};

}  // namespace

std::string_view JointName(JointId joint) { return kNames[static_cast<size_t>(joint)]; }

std::optional<JointId> FindJoint(std::string_view name) {
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (kNames[i] == name) return static_cast<JointId>(i);
  }
  return std::nullopt;
}

JointId MirrorJoint(JointId joint) {
  // In the enumeration every left joint stands right before its right twin.
  const std::string_view name = JointName(joint);
  if (name.starts_with("left_")) return static_cast<JointId>(static_cast<int>(joint) + 1);
  if (name.starts_with("right_")) return static_cast<JointId>(static_cast<int>(joint) - 1);
  return joint;
}

std::span<const JointId> ScoredJoints14() { return kScored14; }

std::span<const JointPair> StickFigure() { return kStickFigure; }

}  // namespace mpc
