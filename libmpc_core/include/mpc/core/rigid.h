// Purpose: rigid transforms whose frames the compiler checks.
//
// Names follow b_from_a: Rigid<CameraFrame, WorldFrame> camera_from_world maps points in the world
// to points in the camera. Composition reads left to right and compiles only if the inner frames
// agree: camera_from_world * world_from_body.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace mpc {

struct CameraFrame {};  // x right, y down, z forward (OpenCV), metres
struct WorldFrame {};   // right-handed; which axis is up is the data's choice, metres
struct ActorFrame {};   // right-handed, y up, the actor's glTF scene at bind, metres

template <typename To, typename From>
struct Rigid {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_from) const {
    return rotation * x_in_from + translation;
  }
  template <typename Other>
  Rigid<To, Other> operator*(const Rigid<From, Other>& from_from_other) const {
    return {rotation * from_from_other.rotation,
            rotation * from_from_other.translation + translation};
  }
  Rigid<From, To> Inverse() const {
    return {rotation.transpose(), -(rotation.transpose() * translation)};
  }
};

using CameraFromWorld = Rigid<CameraFrame, WorldFrame>;

// Rotation vector (axis times angle, rad) of a rotation; angle in [0, pi].
inline Eigen::Vector3d LogSO3(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd angle_axis(rotation);
  return angle_axis.angle() * angle_axis.axis();
}

// CrossMatrix(v) * x = v.cross(x).
inline Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Rotation of a rotation vector (rad).
inline Eigen::Matrix3d ExpSO3(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + CrossMatrix(rotation_vector);
  return Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
}

}  // namespace mpc
