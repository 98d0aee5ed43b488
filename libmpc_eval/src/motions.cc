#include "mpc/eval/motions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <vector>

#include "floor.h"
#include "motion_acts.h"
#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

constexpr double kMaxFrames = 1e6;

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

Eigen::VectorXd PoseAt(const Skeleton& skeleton, MotionKind kind, double t, double seconds) {
  PoseBuilder body(skeleton);
  Act(kind, t, seconds, &body);
  return body.pose();
}

// Moves the root horizontally so that the mean of some joints stays where it is, in the air too.
void StandOn(const Skeleton& skeleton, std::initializer_list<JointId> feet,
             Eigen::MatrixXd* poses) {
  const Eigen::MatrixXd joints = JointTrajectories(skeleton, *poses);
  Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(3, poses->cols());
  for (const JointId id : feet) {
    mean +=
        joints.middleRows<3>(3 * skeleton.FindJointIndex(id)) / static_cast<double>(feet.size());
  }
  for (const int axis : {0, 2}) poses->row(axis).array() -= mean.row(axis).array() - mean(axis, 0);
}

// The lowest joint on the floor, but between take-off and landing a free fall that joins the
// heights there.
void FlyAndStand(const Skeleton& skeleton, double seconds, double fps, double temperature,
                 Eigen::MatrixXd* poses) {
  constexpr double kGravity = 9.81;
  const auto standing = [&](double t) {
    const Eigen::MatrixXd pose = PoseAt(skeleton, MotionKind::kJump, t, seconds);
    return -SoftMin(Heights(JointTrajectories(skeleton, pose).col(0)), temperature);
  };
  for (Eigen::Index f = 0; f < poses->cols(); ++f) {
    const double t = static_cast<double>(f) / fps;
    const Flight flight = FlightAt(t);
    double height = standing(t);
    if (t > flight.takeoff_s && t < flight.landing_s) {
      const double from = standing(flight.takeoff_s);
      const double to = standing(flight.landing_s);
      const double flown = (t - flight.takeoff_s) / (flight.landing_s - flight.takeoff_s);
      height = from + flown * (to - from) +
               0.5 * kGravity * (t - flight.takeoff_s) * (flight.landing_s - t);
    }
    (*poses)(1, f) += height;
  }
  const Eigen::MatrixXd joints = JointTrajectories(skeleton, *poses);
  double lowest = std::numeric_limits<double>::infinity();
  for (Eigen::Index f = 0; f < joints.cols(); ++f) {
    lowest = std::min(lowest, Heights(joints.col(f)).minCoeff());
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
    case MotionKind::kTurnAround:
      return "turnaround";
    case MotionKind::kJump:
      return "jump";
    case MotionKind::kKick:
      return "kick";
    case MotionKind::kSit:
      return "sit";
    case MotionKind::kWave:
      return "wave";
    case MotionKind::kBend:
      return "bend";
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
  Eigen::MatrixXd poses(skeleton.num_dofs(), static_cast<Eigen::Index>(frames));
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    poses.col(f) = PoseAt(skeleton, kind, static_cast<double>(f) / fps, seconds);
  }
  const double temperature_m = 0.004;
  const bool in_place = kind == MotionKind::kTurn || kind == MotionKind::kRoll;
  if (kind == MotionKind::kKick) {
    StandOn(skeleton, {JointId::kLeftToe}, &poses);
  } else if (!in_place && kind != MotionKind::kJump) {
    PlantFeet(skeleton, temperature_m, &poses);
  }
  if (kind == MotionKind::kJump) {
    StandOn(skeleton, {JointId::kLeftToe, JointId::kRightToe}, &poses);
    FlyAndStand(skeleton, seconds, fps, temperature_m, &poses);
    return poses;
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
