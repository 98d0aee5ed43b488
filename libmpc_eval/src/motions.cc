#include "mpc/eval/motions.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "floor.h"
#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kDegree = kPi / 180;
constexpr double kMaxFrames = 1e6;

// One pose whose hinges are set by name; angles are clamped to the bounds.
class PoseBuilder {
 public:
  explicit PoseBuilder(const Skeleton& skeleton) : skeleton_(skeleton), pose_(ZeroPose(skeleton)) {}

  void Root(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
    pose_.head<3>() = translation;
    pose_.segment<3>(3) = LogSO3(rotation);
  }
  void Angle(const std::string& hinge, double angle_rad) {
    const auto it = std::find_if(skeleton_.hinges.begin(), skeleton_.hinges.end(),
                                 [&](const Hinge& h) { return h.name == hinge; });
    if (it == skeleton_.hinges.end()) {
      throw Error(ErrorCode::kInvalidArgument,
                  fmt::format("the skeleton has no hinge named {}, which motions need", hinge));
    }
    pose_[6 + (it - skeleton_.hinges.begin())] = std::clamp(angle_rad, it->min_rad, it->max_rad);
  }
  const Eigen::VectorXd& pose() const { return pose_; }

 private:
  const Skeleton& skeleton_;
  Eigen::VectorXd pose_;
};

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

void Walk(double t, double, PoseBuilder* body) {
  const double phase = 2 * kPi * 0.9 * t;
  const double turn_rad_per_s = 0.9;
  body->Root(AboutY(turn_rad_per_s * t) * AboutZ(0.03 * std::sin(phase)), {0, 0, 0});
  ArmsDown(body);
  StepLeg("left_", phase, 0.40, 0.95, body);
  StepLeg("right_", phase + kPi, 0.40, 0.95, body);
  body->Angle("left_shoulder_flexion", -0.45 * std::cos(phase));
  body->Angle("right_shoulder_flexion", 0.45 * std::cos(phase));
  body->Angle("left_elbow_flexion", 0.45 - 0.25 * std::cos(phase));
  body->Angle("right_elbow_flexion", 0.45 + 0.25 * std::cos(phase));
  body->Angle("spine_flexion", 0.06);
  body->Angle("spine_twist", 0.12 * std::cos(phase));
  body->Angle("neck_twist", 0.25 * std::sin(0.7 * t));
}

void Squat(double t, double, PoseBuilder* body) {
  const double depth = 0.5 * (1 - std::cos(2 * kPi * 0.4 * t));
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
  const double phase = 2 * kPi * 1.2 * t;
  body->Root(AboutY(4 * kPi * SmoothStep(t / seconds)), {0, 0, 0});
  ArmsDown(body);
  StepLeg("left_", phase, 0.04, 0.7, body);
  StepLeg("right_", phase + kPi, 0.04, 0.7, body);
  for (const std::string side : {"left_", "right_"}) {
    body->Angle(side + "shoulder_abduction", -0.9 + 0.3 * std::sin(2 * kPi * 0.5 * t));
    body->Angle(side + "elbow_flexion", 0.5);
  }
}

void Reach(double t, double, PoseBuilder* body) {
  const double slow = 2 * kPi * 0.3 * t;
  const double raise = 0.5 * (1 - std::cos(slow));
  body->Root(AboutY(0.3 * std::sin(slow)), {0, 0, 0});
  ArmsDown(body);
  body->Angle("right_shoulder_abduction", -1.36 + 2.5 * raise);
  body->Angle("right_elbow_flexion", 0.3 + raise * (0.6 + 0.5 * std::sin(2 * kPi * 1.2 * t)));
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
  const double roll = 2 * kPi * SmoothStep(t / seconds);
  const double trunk_radius_m = 0.15;
  // Head towards +x, lying on the back, then rolling about the long axis towards +z.
  body->Root(AboutX(roll) * AboutZ(-0.5 * kPi) * AboutY(-0.5 * kPi),
             {0, 0, trunk_radius_m * (roll - kPi)});
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

// Heights of all joints (x = row 0, y = row 1, z = row 2 of each triple).
Eigen::VectorXd Heights(const Eigen::VectorXd& joints) {
  return joints.reshaped(3, joints.size() / 3).row(1).transpose();
}

// Moves the root horizontally so that whatever carries the body does not slide: each joint near
// the floor counts by how near it is.
void PlantFeet(const Skeleton& skeleton, double temperature, Eigen::MatrixXd* poses) {
  const Eigen::MatrixXd joints = JointTrajectories(skeleton, *poses);
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  for (Eigen::Index f = 1; f < poses->cols(); ++f) {
    const Eigen::VectorXd before = Heights(joints.col(f - 1));
    const Eigen::VectorXd after = Heights(joints.col(f));
    const Eigen::VectorXd height =
        0.5 * (before.array() - before.minCoeff() + after.array() - after.minCoeff());
    const Eigen::VectorXd weight = (-height / temperature).array().exp();
    const Eigen::Matrix3Xd step =
        (joints.col(f) - joints.col(f - 1)).reshaped(3, skeleton.num_joints());
    Eigen::Vector3d slip = step * weight / weight.sum();
    slip.y() = 0;
    offset -= slip;
    poses->col(f).head<3>() += offset;
  }
  const Eigen::Vector3d centre = poses->topRows<3>().rowwise().mean();
  poses->topRows<3>().colwise() -= Eigen::Vector3d(centre.x(), 0, centre.z());
}

// Lowers or lifts every frame until its lowest joint is about on the floor, smoothly in time; the
// lowest joint of the whole motion then lies at y = 0.
void PutOnFloor(const Skeleton& skeleton, double temperature, Eigen::MatrixXd* poses) {
  const Eigen::MatrixXd joints = JointTrajectories(skeleton, *poses);
  double lowest = std::numeric_limits<double>::infinity();
  for (Eigen::Index f = 0; f < poses->cols(); ++f) {
    const Eigen::VectorXd heights = Heights(joints.col(f));
    const double shift = -SoftMin(heights, temperature);
    (*poses)(1, f) += shift;
    lowest = std::min(lowest, heights.minCoeff() + shift);
  }
  poses->row(1).array() -= lowest;
}

}  // namespace

std::string_view MotionName(MotionKind kind) {
  switch (kind) {
    case MotionKind::kWalk:
      return "walk";
    case MotionKind::kSquat:
      return "squat";
    case MotionKind::kTurn:
      return "turn";
    case MotionKind::kReach:
      return "reach";
    case MotionKind::kRoll:
      return "roll";
  }
  throw Error(ErrorCode::kInvalidArgument, "not a MotionKind");
}

Eigen::MatrixXd MakeMotion(const Skeleton& skeleton, MotionKind kind, double seconds, double fps) {
  const double frames = std::round(seconds * fps);
  if (!(frames >= 1 && frames <= kMaxFrames && fps > 0)) {
    throw Error(
        ErrorCode::kInvalidArgument,
        fmt::format("a motion of {} s at {} fps has no sensible number of frames", seconds, fps));
  }
  const auto move = [kind] {
    switch (kind) {
      case MotionKind::kWalk:
        return Walk;
      case MotionKind::kSquat:
        return Squat;
      case MotionKind::kTurn:
        return Turn;
      case MotionKind::kReach:
        return Reach;
      case MotionKind::kRoll:
        return Roll;
    }
    throw Error(ErrorCode::kInvalidArgument, "not a MotionKind");
  }();
  Eigen::MatrixXd poses(skeleton.num_dofs(), static_cast<Eigen::Index>(frames));
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    PoseBuilder body(skeleton);
    move(static_cast<double>(f) / fps, seconds, &body);
    poses.col(f) = body.pose();
  }
  const double temperature_m = 0.004;
  if (kind == MotionKind::kWalk || kind == MotionKind::kSquat || kind == MotionKind::kReach) {
    PlantFeet(skeleton, temperature_m, &poses);
  }
  PutOnFloor(skeleton, temperature_m, &poses);
  return poses;
}

Eigen::MatrixXd TransformPoses(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                               const Eigen::MatrixXd& poses) {
  Eigen::MatrixXd moved = poses;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    moved.col(f).head<3>() = rotation * poses.col(f).head<3>() + translation;
    moved.col(f).segment<3>(3) = LogSO3(rotation * ExpSO3(poses.col(f).segment<3>(3)));
  }
  return moved;
}

Eigen::MatrixXd ResamplePoses(const Eigen::MatrixXd& poses, double from_fps, double to_fps) {
  if (poses.cols() == 0) return poses;
  const double last = static_cast<double>(poses.cols() - 1);
  const double num_frames = std::floor(last * to_fps / from_fps + 1e-9) + 1;
  if (!(from_fps > 0 && to_fps > 0 && num_frames <= kMaxFrames)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{} poses cannot be resampled from {} to {} frames per second",
                            poses.cols(), from_fps, to_fps));
  }
  Eigen::MatrixXd resampled(poses.rows(), static_cast<Eigen::Index>(num_frames));
  for (Eigen::Index i = 0; i < resampled.cols(); ++i) {
    const double at = std::min(last, static_cast<double>(i) * from_fps / to_fps);
    const auto before = static_cast<Eigen::Index>(at);
    const Eigen::Index after = std::min(before + 1, poses.cols() - 1);
    const double fraction = at - static_cast<double>(before);
    resampled.col(i) = (1 - fraction) * poses.col(before) + fraction * poses.col(after);
    const Eigen::Matrix3d from = ExpSO3(poses.col(before).segment<3>(3));
    const Eigen::Matrix3d to = ExpSO3(poses.col(after).segment<3>(3));
    resampled.col(i).segment<3>(3) =
        LogSO3(from * ExpSO3(fraction * LogSO3(from.transpose() * to)));
  }
  return resampled;
}

}  // namespace mpc
