#include "mpc/skeleton/world.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mpc/core/thread_pool.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace mpc {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
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
    for (const Vector3d& d : directions) values.push_back(d[k]);
    median[k] = Percentile(std::move(values), 0.5);
  }
  return median.normalized();
}

// From the middle of the ankles to the middle of the trunk: whoever stands keeps that over the feet,
// also when leaning.
Vector3d StandingDirection(const Skeleton& skeleton, const KinematicState& state) {
  const auto joint = [&](JointId id) -> Vector3d {
    return state.joints.col(skeleton.FindJointIndex(id));
  };
  const Vector3d feet = (joint(JointId::kLeftAnkle) + joint(JointId::kRightAnkle)) / 2;
  const Vector3d trunk = (joint(JointId::kPelvis) + joint(JointId::kNeck)) / 2;
  return (trunk - feet).normalized();
}

// Up as the person shows it, in the camera frame.
void EstimateUp(const Character& character, const Eigen::MatrixXd& poses,
                WorldPlacement* placement) {
  const Vector3d picture_up = -Vector3d::UnitY();
  std::vector<Vector3d> upright;
  KinematicState state;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    ForwardKinematics(character.skeleton, poses.col(f), &state);
    const Vector3d direction = StandingDirection(character.skeleton, state);
    if (AngleBetween(direction, picture_up) < kMaxTilt) upright.push_back(direction);
  }
  placement->up_in_camera = picture_up;
  placement->num_upright_frames = 0;
  if (!upright.empty()) {
    const Vector3d median = MedianDirection(upright);
    Vector3d sum = Vector3d::Zero();
    for (const Vector3d& direction : upright) {
      if (AngleBetween(direction, median) > kMaxSpread) continue;
      sum += direction;
      ++placement->num_upright_frames;
    }
    if (placement->num_upright_frames > 0) placement->up_in_camera = sum.normalized();
  }
  if (10 * placement->num_upright_frames < poses.cols()) {
    placement->warnings.push_back(
        "the person stands upright in less than a tenth of the frames: the direction of gravity "
        "is uncertain");
  }
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

// Height along `up` (camera frame) below which the actor does not stand.
double FloorHeight(const Character& character, const Eigen::MatrixXd& poses, const Vector3d& up,
                   int num_threads) {
  std::vector<double> lowest(static_cast<size_t>(poses.cols()));
  ParallelFor(static_cast<int>(poses.cols()), num_threads, [&](int f) {
    KinematicState state;
    ForwardKinematics(character.skeleton, poses.col(f), &state);
    Eigen::Matrix3Xf vertices;
    SkinCharacter(character, state, &vertices);
    lowest[static_cast<size_t>(f)] =
        (up.cast<float>().transpose() * vertices).cast<double>().minCoeff();
  });
  return Percentile(std::move(lowest), kFloorPercentile);
}

}  // namespace

WorldPlacement PlaceInWorld(const Character& character, const Eigen::MatrixXd& poses,
                            const Camera& camera, int num_threads) {
  WorldPlacement placement;
  EstimateUp(character, poses, &placement);
  Rigid<SceneFrame, CameraFrame> scene_from_camera;
  if (camera.has_extrinsics) {
    placement.world_from_camera = camera.camera_from_world.Inverse();
    Vector3d up_in_world = placement.world_from_camera.rotation * placement.up_in_camera;
    Eigen::Index axis = 0;
    up_in_world.cwiseAbs().maxCoeff(&axis);
    const Vector3d nearest = std::copysign(1.0, up_in_world[axis]) * Vector3d::Unit(axis);
    if (AngleBetween(up_in_world, nearest) < kSnapAngle) up_in_world = nearest;
    placement.up_in_camera = camera.camera_from_world.rotation * up_in_world;
    placement.scene_from_world.rotation = YUpFrom(up_in_world);
    const Rigid<SceneFrame, CameraFrame> above_floor = placement.scene_from_camera();
    placement.scene_from_world.translation.y() =
        -above_floor.translation.y() -
        FloorHeight(character, poses, placement.up_in_camera, num_threads);
  } else {
    placement.world_from_camera.rotation = SceneFromCameraRotation(placement.up_in_camera);
    placement.world_from_camera.translation.y() =
        -FloorHeight(character, poses, placement.up_in_camera, num_threads);
  }
  return placement;
}

}  // namespace mpc
