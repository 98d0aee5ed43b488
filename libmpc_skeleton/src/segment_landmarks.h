// Purpose: joints that are no bones, found on the vertices of the head and the feet.
// Source: ours (DESIGN "Joints from the mesh").
// Frames: the segment's own: x left, y up, z forward, origin at its joint. Units: metres.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace mpc {

struct FaceLandmarks {
  Eigen::Vector3d nose, left_eye, right_eye, left_ear, right_ear;
};

struct HeadLandmarks {
  std::optional<Eigen::Vector3d> top;  // empty: no vertex above the head's joint
  std::optional<FaceLandmarks> face;   // empty: no vertices where a nose could be
};

struct FootLandmarks {
  Eigen::Vector3d big_toe, small_toe, heel;
};

HeadLandmarks FindHeadLandmarks(const Eigen::Matrix3Xd& vertices);

// inner_x: -1 for a left foot, 1 for a right foot. Empty for a foot without extent.
std::optional<FootLandmarks> FindFootLandmarks(const Eigen::Matrix3Xd& vertices, double inner_x);

}  // namespace mpc
