#include "motion_acts.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/core/units.h"

namespace mpc {
namespace {

Eigen::Matrix3d AboutX(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()).toRotationMatrix();
}
Eigen::Matrix3d AboutY(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
}
Eigen::Matrix3d AboutZ(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

// 0 to 1 with zero speed and acceleration at both ends.
double SmoothStep(double x) { return x * x * x * (x * (6 * x - 15) + 10); }

// From 0 to 1 between two times, with zero speed and acceleration at both.
double Rise(double t, double from, double to) {
  return SmoothStep(std::clamp((t - from) / (to - from), 0.0, 1.0));
}

void ArmsDown(PoseBuilder* body) {
  for (const std::string side : {"left_", "right_"}) {
    body->Angle(side + "shoulder_abduction", -78 * kDegree);
    body->Angle(side + "elbow_flexion", 15 * kDegree);
  }
}

// One leg of a step: phase 0 is heel strike, pi toe off, 3 pi / 2 the middle of the swing.
// The sole stays nearly level while the foot carries.
void StepLeg(const std::string& side, double phase, double stride_rad, double lift_rad,
             PoseBuilder* body) {
  const double hip =
      0.25 * stride_rad +
      0.3 * lift_rad * std::max(0.0, -std::sin(phase)) * std::max(0.0, -std::sin(phase)) +
      stride_rad * std::cos(phase);
  const double swing = 0.5 * (1 - std::sin(phase));
  const double knee = 0.12 + lift_rad * swing * swing * swing;
  body->Angle(side + "hip_flexion", hip);
  body->Angle(side + "knee_flexion", knee);
  body->Angle(side + "ankle_flexion", 0.8 * (knee - hip));
}

// Steps of full or shorter length with swinging arms.
void Stride(double phase, double length, PoseBuilder* body) {
  ArmsDown(body);
  StepLeg("left_", phase, 0.40 * length, 0.55 + 0.40 * length, body);
  StepLeg("right_", phase + std::numbers::pi, 0.40 * length, 0.55 + 0.40 * length, body);
  const double swing = length * std::cos(phase);
  body->Angle("left_shoulder_flexion", -0.45 * swing);
  body->Angle("right_shoulder_flexion", 0.45 * swing);
  body->Angle("left_elbow_flexion", 0.45 - 0.25 * swing);
  body->Angle("right_elbow_flexion", 0.45 + 0.25 * swing);
  body->Angle("spine_flexion", 0.06);
  body->Angle("spine_twist", 0.12 * swing);
}

void Walk(double t, double, PoseBuilder* body) {
  const double phase = 2 * std::numbers::pi * 0.9 * t;
  const double turn_rad_per_s = 0.9;
  body->Root(AboutY(turn_rad_per_s * t) * AboutZ(0.03 * std::sin(phase)), {0, 0, 0});
  Stride(phase, 1, body);
  body->Angle("neck_twist", 0.25 * std::sin(0.7 * t));
}

// Straight on, half a turn on small steps, and back.
void TurnAround(double t, double seconds, PoseBuilder* body) {
  const double phase = 2 * std::numbers::pi * 0.9 * t;
  const double half = 0.5 * std::min(1.5, seconds);
  const double middle = 0.5 * seconds;
  const double turned = Rise(t, middle - half, middle + half);
  const double shorter = Rise(t, middle - 1.6 * half, middle - 0.8 * half) *
                         (1 - Rise(t, middle + 0.8 * half, middle + 1.6 * half));
  body->Root(AboutY(std::numbers::pi * turned) * AboutZ(0.03 * std::sin(phase)), {0, 0, 0});
  Stride(phase, 1 - 0.7 * shorter, body);
  // The head goes first.
  const double ahead = Rise(t + 0.2, middle - half, middle + half);
  body->Angle("neck_twist", 1.6 * (ahead - turned));
}

void Squat(double t, double, PoseBuilder* body) {
  const double depth = 0.5 * (1 - std::cos(2 * std::numbers::pi * 0.4 * t));
  const double lean = 0.45 * depth;
  body->Root(AboutX(lean), {0, 0, 0});
  ArmsDown(body);
  for (const std::string side : {"left_", "right_"}) {
    const double hip = 1.90 * depth;
    const double knee = 1.85 * depth;
    body->Angle(side + "hip_flexion", hip);
    body->Angle(side + "knee_flexion", knee);
    body->Angle(side + "ankle_flexion", lean - hip + knee);  // keeps the sole level
    body->Angle(side + "shoulder_flexion", 0.05 + 1.45 * depth);
  }
  body->Angle("spine_flexion", 0.15 * depth);
  body->Angle("neck_flexion", -0.4 * depth);
}

void Turn(double t, double seconds, PoseBuilder* body) {
  const double phase = 2 * std::numbers::pi * 1.2 * t;
  body->Root(AboutY(4 * std::numbers::pi * SmoothStep(t / seconds)), {0, 0, 0});
  ArmsDown(body);
  StepLeg("left_", phase, 0.04, 0.7, body);
  StepLeg("right_", phase + std::numbers::pi, 0.04, 0.7, body);
  for (const std::string side : {"left_", "right_"}) {
    body->Angle(side + "shoulder_abduction", -0.9 + 0.3 * std::sin(2 * std::numbers::pi * 0.5 * t));
    body->Angle(side + "elbow_flexion", 0.5);
  }
}

void Reach(double t, double, PoseBuilder* body) {
  const double slow = 2 * std::numbers::pi * 0.3 * t;
  const double raise = 0.5 * (1 - std::cos(slow));
  body->Root(AboutY(0.3 * std::sin(slow)), {0, 0, 0});
  ArmsDown(body);
  body->Angle("right_shoulder_abduction", -1.36 + 2.5 * raise);
  body->Angle("right_elbow_flexion",
              0.3 + raise * (0.6 + 0.5 * std::sin(2 * std::numbers::pi * 1.2 * t)));
  body->Angle("left_shoulder_flexion", 1.5 * raise);
  body->Angle("left_elbow_flexion", 0.5 - 0.4 * raise);
  body->Angle("spine_flexion", 0.5 * raise);
  body->Angle("spine_lateral", 0.2 * std::sin(slow));
  body->Angle("spine_twist", 0.35 * std::sin(slow));
  body->Angle("neck_twist", 0.6 * std::sin(2 * slow));
  body->Angle("head_nod", 0.15 * std::sin(slow));
  for (const std::string side : {"left_", "right_"}) {
    const double knee = 0.15 + 0.25 * raise;
    body->Angle(side + "hip_abduction", 0.15);
    body->Angle(side + "hip_flexion", 0.5 * knee);
    body->Angle(side + "knee_flexion", knee);
    body->Angle(side + "ankle_flexion", 0.5 * knee);
    body->Angle(side + "ankle_eversion", -0.15);
  }
}

void Roll(double t, double seconds, PoseBuilder* body) {
  const double roll = 2 * std::numbers::pi * SmoothStep(t / seconds);
  const double trunk_radius_m = 0.15;
  // Head towards +x, lying on the back, then rolling about the long axis towards +z.
  body->Root(AboutX(roll) * AboutZ(-0.5 * std::numbers::pi) * AboutY(-0.5 * std::numbers::pi),
             {0, 0, trunk_radius_m * (roll - std::numbers::pi)});
  ArmsDown(body);
  const double tuck = std::sin(0.5 * roll) * std::sin(0.5 * roll);
  for (const std::string side : {"left_", "right_"}) {
    body->Angle(side + "shoulder_flexion", 0.7 * tuck);
    body->Angle(side + "elbow_flexion", 0.26 + 1.5 * tuck);
    body->Angle(side + "hip_flexion", 0.2 + 0.5 * tuck);
    body->Angle(side + "knee_flexion", 0.2 + 0.8 * tuck);
    body->Angle(side + "ankle_flexion", -0.4);
  }
  body->Angle("neck_flexion", 0.3);
}

// Knees, hips and ankles of both legs such that the hips sink by `depth` (0 to 1 of the deepest),
// the soles level; heels lift by `tiptoe`.
void Crouch(double depth, double lean, double tiptoe, PoseBuilder* body) {
  const double knee = std::acos(1 - std::clamp(depth, 0.0, 1.0) * (1 - std::cos(1.35)));
  const double hip = 0.5 * knee + lean;
  body->Root(AboutX(lean), {0, 0, 0});
  for (const std::string side : {"left_", "right_"}) {
    body->Angle(side + "hip_flexion", hip);
    body->Angle(side + "hip_abduction", 0.06);
    body->Angle(side + "knee_flexion", knee);
    body->Angle(side + "ankle_flexion", lean - hip + knee - tiptoe);
  }
}

constexpr double kJumpPeriodS = 2.2;
constexpr double kTakeoffS = 0.85;
constexpr double kLandingS = 1.31;

// Swings down, pushes off, flies, lands on bent knees and straightens.
void Jump(double t, double, PoseBuilder* body) {
  const double s = t - kJumpPeriodS * std::floor(t / kJumpPeriodS);
  const double push = std::clamp((s - 0.65) / (kTakeoffS - 0.65), 0.0, 1.0);
  const double absorb = std::clamp((s - kLandingS) / 0.22, 0.0, 1.0);
  const double contact = 0.12;  // how deep at take-off and landing
  double depth = Rise(s, 0.1, 0.6);
  if (s > 0.65) depth = 1 + (contact - 1) * push * push;
  if (s > kTakeoffS) {
    // Legs drawn up a little in the air.
    const double air = (s - kTakeoffS) / (kLandingS - kTakeoffS);
    depth = contact + 0.30 * std::pow(std::sin(std::numbers::pi * std::min(air, 1.0)), 2);
  }
  if (s > kLandingS) {
    depth = contact + 0.75 * (1 - (1 - absorb) * (1 - absorb));
    depth *= 1 - Rise(s, kLandingS + 0.22, kJumpPeriodS - 0.1);
  }
  const double toes = 0.55 * (Rise(s, 0.74, kTakeoffS) - Rise(s, kLandingS, kLandingS + 0.10));
  ArmsDown(body);
  Crouch(depth, 0.35 * depth, toes, body);
  const double back = Rise(s, 0.1, 0.5) - Rise(s, 0.5, 0.8);
  const double up = Rise(s, 0.55, 1.05) - Rise(s, 1.1, 1.7);
  for (const std::string side : {"left_", "right_"}) {
    body->Angle(side + "shoulder_flexion", -0.8 * back + 1.9 * up);
    body->Angle(side + "elbow_flexion", 0.3 + 0.5 * up);
  }
  body->Angle("spine_flexion", 0.25 * depth);
  body->Angle("neck_flexion", -0.25 * depth);
}

// The right leg swings back and up in front; the left one carries.
void Kick(double t, double, PoseBuilder* body) {
  const double period = 2.0;
  const double s = t - period * std::floor(t / period);
  const double back = Rise(s, 0.2, 0.7) - Rise(s, 0.7, 1.0);
  const double front = Rise(s, 0.7, 1.25) - Rise(s, 1.3, 1.95);
  // Bent while it passes the other leg, or it would touch the floor.
  const double bent =
      Rise(s, 0.2, 0.7) - Rise(s, 0.9, 1.3) + 0.3 * (Rise(s, 1.3, 1.6) - Rise(s, 1.7, 1.95));
  const double lean = 0.12 * back - 0.20 * front;
  body->Root(AboutY(-0.25 * front + 0.2 * back) * AboutX(lean), {0, 0, 0});
  ArmsDown(body);
  const double knee = 0.15 + 0.15 * (back + front);
  const double hip = 0.5 * knee + lean;
  body->Angle("left_hip_flexion", hip);
  body->Angle("left_knee_flexion", knee);
  body->Angle("left_ankle_flexion", lean - hip + knee);
  body->Angle("right_hip_flexion", hip - 0.55 * back + 1.35 * front);
  body->Angle("right_knee_flexion", knee + 1.25 * bent);
  body->Angle("right_ankle_flexion", (lean - hip + knee) * (1 - front) - 0.4 * front);
  body->Angle("left_shoulder_flexion", -0.3 * back + 0.9 * front);
  body->Angle("right_shoulder_flexion", 0.6 * back - 0.7 * front);
  for (const std::string side : {"left_", "right_"}) {
    body->Angle(side + "shoulder_abduction", -1.30 + 0.5 * (back + front));
    body->Angle(side + "elbow_flexion", 0.3 + 0.3 * (back + front));
  }
  body->Angle("spine_flexion", 0.15 * back + 0.25 * front);
  body->Angle("spine_twist", 0.25 * (front - back));
}

// Down onto a seat, and up again.
void Sit(double t, double, PoseBuilder* body) {
  const double period = 4;
  const double s = t - period * std::floor(t / period);
  const double down = Rise(s, 0.3, 1.5) - Rise(s, 2.6, 3.7);
  const double moving = 4 * down * (1 - down);  // the trunk leans forward on the way
  const double lean = 0.08 * down + 0.50 * moving;
  body->Root(AboutX(lean), {0, 0, 0});
  ArmsDown(body);
  for (const std::string side : {"left_", "right_"}) {
    const double knee = 1.60 * down;
    const double hip = 1.45 * down + lean;
    body->Angle(side + "hip_flexion", hip);
    body->Angle(side + "hip_abduction", 0.10);
    body->Angle(side + "knee_flexion", knee);
    body->Angle(side + "ankle_flexion", lean - hip + knee);
    // The hands come to lie on the thighs.
    body->Angle(side + "shoulder_flexion", 0.05 + 0.20 * down + 0.5 * moving);
    body->Angle(side + "shoulder_twist", 0.35 * down);
    body->Angle(side + "elbow_flexion", 0.26 + 0.79 * down - 0.3 * moving);
  }
  body->Angle("spine_flexion", 0.10 * down + 0.10 * moving);
  body->Angle("neck_flexion", -0.35 * moving);
  body->Angle("neck_twist", 0.5 * down * std::sin(2 * std::numbers::pi * 0.4 * s));
}

// Stands and waves the right hand beside the head.
void Wave(double t, double seconds, PoseBuilder* body) {
  const double raised = Rise(t, 0.1, 0.9) - Rise(t, seconds - 0.8, seconds);
  const double swing = std::sin(2 * std::numbers::pi * 1.4 * t);
  const double sway = std::sin(2 * std::numbers::pi * 0.35 * t);
  body->Root(AboutZ(0.02 * sway), {0, 0, 0});
  ArmsDown(body);
  body->Angle("right_shoulder_abduction", -1.36 + 1.45 * raised);
  body->Angle("right_shoulder_twist", -1.45 * raised);
  body->Angle("right_elbow_flexion", 0.26 + raised * (1.25 + 0.38 * swing));
  body->Angle("left_shoulder_flexion", 0.06 * sway);
  for (const std::string side : {"left_", "right_"}) {
    body->Angle(side + "hip_abduction", side == "left_" ? 0.08 - 0.02 * sway : 0.08 + 0.02 * sway);
    body->Angle(side + "hip_flexion", 0.03);
    body->Angle(side + "knee_flexion", 0.06);
    body->Angle(side + "ankle_flexion", 0.03);
    body->Angle(side + "ankle_eversion", -0.08);
  }
  body->Angle("spine_lateral", -0.05 * raised + 0.03 * sway);
  body->Angle("spine_twist", 0.06 * sway);
  body->Angle("neck_twist", 0.12 * sway);
}

// Bows down to the floor, arms hanging, and comes up again.
void Bend(double t, double, PoseBuilder* body) {
  const double down = 0.5 * (1 - std::cos(2 * std::numbers::pi * 0.35 * t));
  const double lean = 0.75 * down;
  body->Root(AboutX(lean), {0, 0, 0});
  ArmsDown(body);
  for (const std::string side : {"left_", "right_"}) {
    const double knee = 0.05 + 0.35 * down;
    const double hip = lean + 0.5 * knee - 0.10 * down;
    body->Angle(side + "hip_flexion", hip);
    body->Angle(side + "knee_flexion", knee);
    body->Angle(side + "ankle_flexion", lean - hip + knee);
    body->Angle(side + "shoulder_flexion", 0.05 + 1.45 * down);
    body->Angle(side + "elbow_flexion", 0.26 - 0.15 * down);
  }
  body->Angle("spine_flexion", 0.05 + 0.95 * down);
  body->Angle("neck_flexion", 0.25 * down);
}

}  // namespace

void PoseBuilder::Root(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
  pose_.head<3>() = translation;
  pose_.segment<3>(3) = LogSO3(rotation);
}

void PoseBuilder::Angle(const std::string& hinge, double angle_rad) {
  const auto it = std::find_if(skeleton_.hinges.begin(), skeleton_.hinges.end(),
                               [&](const Hinge& h) { return h.name == hinge; });
  if (it == skeleton_.hinges.end()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("the skeleton has no hinge named {}, which motions need", hinge));
  }
  pose_[6 + (it - skeleton_.hinges.begin())] = std::clamp(angle_rad, it->min_rad, it->max_rad);
}

void Act(MotionKind kind, double t, double seconds, PoseBuilder* body) {
  switch (kind) {
    case MotionKind::kWalk:
      return Walk(t, seconds, body);
    case MotionKind::kSquat:
      return Squat(t, seconds, body);
    case MotionKind::kTurn:
      return Turn(t, seconds, body);
    case MotionKind::kReach:
      return Reach(t, seconds, body);
    case MotionKind::kRoll:
      return Roll(t, seconds, body);
    case MotionKind::kTurnAround:
      return TurnAround(t, seconds, body);
    case MotionKind::kJump:
      return Jump(t, seconds, body);
    case MotionKind::kKick:
      return Kick(t, seconds, body);
    case MotionKind::kSit:
      return Sit(t, seconds, body);
    case MotionKind::kWave:
      return Wave(t, seconds, body);
    case MotionKind::kBend:
      return Bend(t, seconds, body);
  }
  throw Error(ErrorCode::kInvalidArgument, "not a MotionKind");
}

Flight FlightAt(double t) {
  const double start = kJumpPeriodS * std::floor(t / kJumpPeriodS);
  return {start + kTakeoffS, start + kLandingS};
}

}  // namespace mpc
