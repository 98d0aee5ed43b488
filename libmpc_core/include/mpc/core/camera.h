// Purpose: pinhole camera with Brown-Conrady distortion.
// Source: OpenCV's camera model (k1, k2, p1, p2, k3); Brown 1971.
// Frames: camera frame x right, y down, z forward. Pixel centres at integer coordinates.
// Units: metres, pixels.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

#include "mpc/core/rigid.h"

namespace mpc {

struct Camera {
  std::string name;
  int width = 0;  // px
  int height = 0;
  double fx = 0;  // focal lengths, px
  double fy = 0;
  double cx = 0;  // principal point, px
  double cy = 0;
  std::array<double, 5> distortion = {0, 0, 0, 0, 0};  // k1, k2, p1, p2, k3
  CameraFromWorld camera_from_world;
  bool has_extrinsics = false;  // camera_from_world is known, not just the identity

  // A camera without distortion whose principal point is the image centre and whose field of view
  // (rad) spans the longer side. Throws Error for a size below 1 or an angle outside (0, pi).
  static Camera FromFov(int width, int height, double fov_rad);

  // Throws Error (kInvalidArgument) naming every fault: sizes, focal lengths, non-finite values,
  // a rotation that is not orthonormal.
  void Validate() const;

  // The same camera for an image resized to width x height (both axes scaled alike to 1 %);
  // throws Error (kMismatch) when the aspect ratio differs.
  Camera ScaledTo(int new_width, int new_height) const;
};

// Projects a point in the camera frame. Returns false, leaving the outputs alone, when the point is
// not in front of the camera (z < 1e-6 m) or lies outside the distortion model's invertible range.
// jacobian, if given, is d pixel / d x_in_camera, 2x3.
bool Project(const Camera& camera, const Eigen::Vector3d& x_in_camera, Eigen::Vector2d* pixel,
             Eigen::Matrix<double, 2, 3>* jacobian = nullptr);

// The normalised image point (x/z, y/z) seen at a pixel: undoes intrinsics and distortion (Newton,
// to 1e-12). Pixels outside the invertible range give the nearest solution found.
Eigen::Vector2d Undistort(const Camera& camera, const Eigen::Vector2d& pixel);

// Unit vector in the camera frame through a pixel.
Eigen::Vector3d PixelRay(const Camera& camera, const Eigen::Vector2d& pixel);

// The smallest rotation that turns the optical axis (0,0,1) onto `ray_in_camera`:
// camera_from_ray. In the ray frame z runs along the ray. Networks that look at a crop give 3D
// orientation in this frame, not in the camera's.
Eigen::Matrix3d CameraFromRay(const Eigen::Vector3d& ray_in_camera);

}  // namespace mpc
