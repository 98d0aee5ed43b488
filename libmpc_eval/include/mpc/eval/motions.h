// Purpose: closed-form performances for tests, benchmarks and the demo, and simple operations on
// motions: another frame, another frame rate, feet on the floor.
// Frames: world, y up, floor at y = 0, unless said otherwise. Units: metres, radians, seconds.
// Symbols: N dofs, F frames; poses are N x F (mpc/skeleton/skeleton.h).
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>

#include "mpc/skeleton/skeleton.h"

namespace mpc {

enum class MotionKind {
  kWalk,        // on a circle, the supporting foot at rest
  kSquat,       // deep knee bends, arms swinging forward
  kTurn,        // 720 degrees on the spot, stepping
  kReach,       // one arm waves overhead, the other reaches, the trunk bends and twists
  kRoll,        // lying on the floor, rolling over sideways by 360 degrees
  kTurnAround,  // walks straight on, turns around, walks back
  kJump,        // from a crouch straight up, in free fall, landing on bent knees
  kKick,        // the right leg swings up in front
  kSit,         // down onto a seat (mpc/eval/stool.h), and up again
  kWave,        // one hand beside the head
  kBend,        // bows down to the floor
};
inline constexpr std::array<MotionKind, 11> kAllMotions = {
    MotionKind::kWalk, MotionKind::kSquat,      MotionKind::kTurn, MotionKind::kReach,
    MotionKind::kRoll, MotionKind::kTurnAround, MotionKind::kJump, MotionKind::kKick,
    MotionKind::kSit,  MotionKind::kWave,       MotionKind::kBend};

// Short lower-case name, such as "walk".
std::string_view MotionName(MotionKind kind);

// The motion for a skeleton with the default skeleton's hinge names, round(seconds * fps) frames
// starting at t = 0, around the origin, inside the hinge bounds. The lowest joint stays near the
// floor, jumps apart, and touches y = 0 at least once. Throws Error (kInvalidArgument) for an unknown skeleton or
// for seconds * fps outside [1, 1e6].
Eigen::MatrixXd MakeMotion(const Skeleton& skeleton, MotionKind kind, double seconds, double fps);

// The same poses seen from another frame: roots become R * root + t. Output as input, N x F.
Eigen::MatrixXd TransformPoses(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                               const Eigen::MatrixXd& poses);

// The motion at another frame rate, from the same first frame to the last time inside it: linear
// for translation and angles, shortest arc for the root rotation. Throws Error (kInvalidArgument)
// for rates that are not positive or a result of more than 1e6 frames.
Eigen::MatrixXd ResamplePoses(const Eigen::MatrixXd& poses, double from_fps, double to_fps);

}  // namespace mpc
