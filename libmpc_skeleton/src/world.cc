#include "mpc/skeleton/world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/core/units.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace mpc {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kMaxTilt = 70 * kDegree;    // of an upright person from the picture's up
constexpr double kMaxSpread = 30 * kDegree;  // of upright frames from their median
constexpr double kSnapAngle = 25 * kDegree;  // up to a world axis
constexpr double kFloorPercentile = 0.2;

double AngleBetween(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

double Percentile(std::vector<double> values, double fraction) {
  const auto index = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return values[static_cast<size_t>(index)];
}

Vector3d MedianDirection(const std::vector<Vector3d>& directions) {
  Vector3d median;
  for (int k = 0; k < 3; ++k) {
    std::vector<double> values;
    values.reserve(directions.size());
    for (const Vector3d& d : directions) values.push_back(d[k]);
    median[k] = Percentile(std::move(values), 0.5);
  }
  return median.normalized();
}

using Base = std::vector<Rigid<WorldFrame, CameraFrame>>;  // from the camera, per frame

// Up as the person shows it, in the base.
Vector3d EstimateUp(const Character& character, const Eigen::MatrixXd& poses, const Base& base,
                    WorldPlacement* placement) {
  Vector3d picture_up_sum = Vector3d::Zero();
  std::vector<Vector3d> upright;
  KinematicState state;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    const Vector3d picture_up = -base[f].rotation.col(1);
    picture_up_sum += picture_up;
    ForwardKinematics(character.skeleton, poses.col(f), &state);
    const Vector3d direction = base[f].rotation * StandingDirection(character.skeleton, state);
    if (AngleBetween(direction, picture_up) < kMaxTilt) upright.push_back(direction);
  }
  Vector3d up = picture_up_sum.norm() > 0 ? picture_up_sum : Vector3d(-base[0].rotation.col(1));
  if (!upright.empty()) {
    const Vector3d median = MedianDirection(upright);
    Vector3d sum = Vector3d::Zero();
    for (const Vector3d& direction : upright) {
      if (AngleBetween(direction, median) > kMaxSpread) continue;
      sum += direction;
      ++placement->num_upright_frames;
    }
    if (placement->num_upright_frames > 0) up = sum;
  }
  if (10 * placement->num_upright_frames < poses.cols()) {
    placement->warnings.push_back(
        "the person stands upright in less than a tenth of the frames: the direction of gravity "
        "is uncertain");
  }
  return up.normalized();
}

// The smallest rotation onto y, exact when `up` is an axis.
Matrix3d YUpFrom(const Vector3d& up) {
  const Matrix3d rotation =
      Eigen::Quaterniond::FromTwoVectors(up, Vector3d::UnitY()).toRotationMatrix();
  const bool is_axis = up.cwiseAbs().maxCoeff() == 1;
  return is_axis ? Matrix3d(rotation.array().round() + 0.0) : rotation;  // no negative zeros
}

// y up, the camera's view direction towards -z as far as it is horizontal.
Matrix3d SceneFromCameraRotation(const Vector3d& up) {
  Vector3d back = -Vector3d::UnitZ();
  if (back.cross(up).norm() < 0.1) back = Vector3d(0, up.z() < 0 ? 1 : -1, 0);
  const Vector3d z = (back - up.dot(back) * up).normalized();
  Matrix3d rotation;
  rotation << up.cross(z).transpose(), up.transpose(), z.transpose();
  return rotation;
}

// Height along `up` (both in the base) below which the actor does not stand.
double FloorHeight(const Character& character, const Eigen::MatrixXd& poses, const Base& base,
                   const Vector3d& up, int num_threads) {
  std::vector<double> lowest(static_cast<size_t>(poses.cols()));
  ParallelFor(static_cast<int>(poses.cols()), num_threads, [&](int f) {
    KinematicState state;
    ForwardKinematics(character.skeleton, poses.col(f), &state);
    Eigen::Matrix3Xf vertices;
    SkinCharacter(character, state, &vertices);
    const Vector3d up_in_camera = base[f].rotation.transpose() * up;
    lowest[static_cast<size_t>(f)] =
        (up_in_camera.cast<float>().transpose() * vertices).cast<double>().minCoeff() +
        up.dot(base[f].translation);
  });
  return Percentile(std::move(lowest), kFloorPercentile);
}

}  // namespace

std::vector<Rigid<WorldFrame, CameraFrame>> BaseFromCamera(const Camera& camera,
                                                           std::span<const CameraFromWorld> motion,
                                                           Eigen::Index num_frames) {
  if (!motion.empty() && static_cast<Eigen::Index>(motion.size()) != num_frames) {
    throw Error(ErrorCode::kMismatch, fmt::format("the moving camera has {} places for {} frames",
                                                  motion.size(), num_frames));
  }
  std::vector<Rigid<WorldFrame, CameraFrame>> base;
  for (const CameraFromWorld& place : motion) base.push_back(place.Inverse());
  if (!base.empty()) return base;
  const CameraFromWorld still =
      camera.has_extrinsics ? camera.camera_from_world : CameraFromWorld{};
  base.assign(static_cast<size_t>(num_frames), still.Inverse());
  return base;
}

Vector3d StandingDirection(const Skeleton& skeleton, const KinematicState& state) {
  const auto joint = [&](JointId id) -> Vector3d {
    return state.joints.col(skeleton.FindJointIndex(id));
  };
  const Vector3d feet = (joint(JointId::kLeftAnkle) + joint(JointId::kRightAnkle)) / 2;
  const Vector3d trunk = (joint(JointId::kPelvis) + joint(JointId::kNeck)) / 2;
  return (trunk - feet).normalized();
}

Vector3d SnappedToAxis(const Vector3d& up) {
  Eigen::Index axis = 0;
  up.cwiseAbs().maxCoeff(&axis);
  const Vector3d nearest = std::copysign(1.0, up[axis]) * Vector3d::Unit(axis);
  return AngleBetween(up, nearest) < kSnapAngle ? nearest : up;
}

WorldPlacement PlaceInWorld(const Character& character, const Eigen::MatrixXd& poses,
                            const Camera& camera, std::span<const CameraFromWorld> motion,
                            int num_threads) {
  WorldPlacement placement;
  const Base base = BaseFromCamera(camera, motion, poses.cols());
  Vector3d up = EstimateUp(character, poses, base, &placement);
  if (camera.has_extrinsics) up = SnappedToAxis(up);
  const double floor = FloorHeight(character, poses, base, up, num_threads);
  placement.up_in_camera = base[0].rotation.transpose() * up;
  Rigid<WorldFrame, WorldFrame> world_from_base;
  if (camera.has_extrinsics) {
    placement.scene_from_world = {.rotation = YUpFrom(up), .translation = {0, -floor, 0}};
  } else {
    world_from_base = {.rotation = SceneFromCameraRotation(up), .translation = {0, -floor, 0}};
  }
  placement.world_from_camera = world_from_base * base[0];
  if (motion.empty()) return placement;
  for (const Rigid<WorldFrame, CameraFrame>& place : base) {
    placement.moving_world_from_camera.push_back(world_from_base * place);
  }
  return placement;
}

}  // namespace mpc
