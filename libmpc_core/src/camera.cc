#include "mpc/core/camera.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr int kMaxSide_px = 1 << 16;
constexpr double kMinDepth_m = 1e-6;

bool HasDistortion(const Camera& camera) {
  return std::any_of(camera.distortion.begin(), camera.distortion.end(),
                     [](double k) { return k != 0; });
}

// True when r -> r (1 + k1 r^2 + k2 r^4 + k3 r^6) increases all the way from the centre to r.
bool RadiallyInvertible(const Camera& camera, double r_sq) {
  const double k1 = camera.distortion[0], k2 = camera.distortion[1], k3 = camera.distortion[4];
  // Near the centre even the worst signs keep the slope positive.
  if (r_sq * (3 * std::abs(k1) + r_sq * (5 * std::abs(k2) + r_sq * 7 * std::abs(k3))) < 1) {
    return true;
  }
  const auto slope = [&](double s) { return 1 + s * (3 * k1 + s * (5 * k2 + s * 7 * k3)); };
  if (!(slope(r_sq) > 0)) return false;
  // The slope's minimum on [0, r^2] lies at an end or where its derivative vanishes.
  const double a = 21 * k3, half_b = 5 * k2, c = 3 * k1;
  const double discriminant = half_b * half_b - a * c;
  if (discriminant < 0) return true;
  const double q = -(half_b + std::copysign(std::sqrt(discriminant), half_b));
  for (const double s : {q / a, c / q}) {
    if (s > 0 && s < r_sq && !(slope(s) > 0)) return false;
  }
  return true;
}

// Distorts a normalised image point; false outside the model's invertible range.
bool Distort(const Camera& camera, const Eigen::Vector2d& p, Eigen::Vector2d* distorted,
             Eigen::Matrix2d* jacobian) {
  const auto [k1, k2, p1, p2, k3] = camera.distortion;
  const double x = p.x(), y = p.y();
  const double r_sq = p.squaredNorm();
  if (!RadiallyInvertible(camera, r_sq)) return false;
  const double radial = 1 + r_sq * (k1 + r_sq * (k2 + r_sq * k3));
  const double radial_slope = k1 + r_sq * (2 * k2 + r_sq * 3 * k3);  // d radial / d r^2
  const double mixed = 2 * x * y * radial_slope + 2 * p1 * x + 2 * p2 * y;
  Eigen::Matrix2d d;
  d << radial + 2 * x * x * radial_slope + 2 * p1 * y + 6 * p2 * x, mixed,  //
      mixed, radial + 2 * y * y * radial_slope + 6 * p1 * y + 2 * p2 * x;
  if (!(d.determinant() > 0)) return false;
  *distorted = radial * p + Eigen::Vector2d(2 * p1 * x * y + p2 * (r_sq + 2 * x * x),
                                            p1 * (r_sq + 2 * y * y) + 2 * p2 * x * y);
  *jacobian = d;
  return true;
}

}  // namespace

Camera Camera::FromFov(int width, int height, double fov_rad) {
  if (!(fov_rad > 0 && fov_rad < std::numbers::pi)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("camera: field of view {} rad, expected between 0 and pi", fov_rad));
  }
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 0.5 * std::max(width, height) / std::tan(0.5 * fov_rad);
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  camera.Validate();
  return camera;
}

void Camera::Validate() const {
  std::vector<std::string> faults;
  if (width < 1 || height < 1 || width > kMaxSide_px || height > kMaxSide_px) {
    faults.push_back(fmt::format("size {} x {} is not within 1 to {}", width, height, kMaxSide_px));
  }
  if (!(fx > 0 && fy > 0 && std::isfinite(fx) && std::isfinite(fy))) {
    faults.push_back(fmt::format("focal lengths {} and {} px are not positive", fx, fy));
  }
  if (!std::isfinite(cx) || !std::isfinite(cy)) {
    faults.push_back(fmt::format("principal point ({}, {}) is not finite", cx, cy));
  }
  for (const double k : distortion) {
    if (!std::isfinite(k)) faults.push_back("a distortion coefficient is not finite");
  }
  const Eigen::Matrix3d& rotation = camera_from_world.rotation;
  const double error =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error < 1e-4) || rotation.determinant() < 0) {
    faults.push_back("the rotation is not orthonormal and right-handed");
  }
  if (!camera_from_world.translation.allFinite()) faults.push_back("the translation is not finite");
  if (!faults.empty()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("camera '{}': {}", name, fmt::join(faults, "; ")));
  }
}

Camera Camera::ScaledTo(int new_width, int new_height) const {
  const double scale_x = static_cast<double>(new_width) / width;
  const double scale_y = static_cast<double>(new_height) / height;
  if (!(scale_x > 0 && scale_y > 0 && std::abs(scale_x / scale_y - 1) <= 0.01)) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("camera '{}' is for {} x {} pictures, which do not resize to {} x {} "
                            "with the same aspect ratio",
                            name, width, height, new_width, new_height));
  }
  Camera scaled = *this;
  scaled.width = new_width;
  scaled.height = new_height;
  scaled.fx *= scale_x;
  scaled.fy *= scale_y;
  // The pictures' edges coincide, half a pixel outside the border pixels' centres.
  scaled.cx = (cx + 0.5) * scale_x - 0.5;
  scaled.cy = (cy + 0.5) * scale_y - 0.5;
  return scaled;
}

bool Project(const Camera& camera, const Eigen::Vector3d& x_in_camera, Eigen::Vector2d* pixel,
             Eigen::Matrix<double, 2, 3>* jacobian) {
  const double z = x_in_camera.z();
  if (!(z >= kMinDepth_m)) return false;
  const Eigen::Vector2d p = x_in_camera.head<2>() / z;
  Eigen::Vector2d distorted = p;
  Eigen::Matrix2d d_distorted_d_p = Eigen::Matrix2d::Identity();
  if (HasDistortion(camera) && !Distort(camera, p, &distorted, &d_distorted_d_p)) return false;
  const Eigen::Vector2d result(camera.fx * distorted.x() + camera.cx,
                               camera.fy * distorted.y() + camera.cy);
  if (!result.allFinite()) return false;
  *pixel = result;
  if (jacobian != nullptr) {
    Eigen::Matrix<double, 2, 3> d_p_d_x;
    d_p_d_x << 1 / z, 0, -p.x() / z,  //
        0, 1 / z, -p.y() / z;
    *jacobian = Eigen::Vector2d(camera.fx, camera.fy).asDiagonal() * d_distorted_d_p * d_p_d_x;
  }
  return true;
}

Eigen::Vector2d Undistort(const Camera& camera, const Eigen::Vector2d& pixel) {
  constexpr int kMaxIterations = 50;
  constexpr int kMaxHalvings = 40;
  constexpr double kTolerance = 1e-12;
  const Eigen::Vector2d target((pixel.x() - camera.cx) / camera.fx,
                               (pixel.y() - camera.cy) / camera.fy);
  if (!HasDistortion(camera)) return target;

  Eigen::Vector2d p = target, distorted;
  Eigen::Matrix2d jacobian;
  for (int i = 0; !Distort(camera, p, &distorted, &jacobian); ++i) {
    p = i < kMaxHalvings ? Eigen::Vector2d(0.5 * p) : Eigen::Vector2d::Zero();
  }
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::Vector2d residual = target - distorted;
    if (residual.norm() < kTolerance) break;
    // Newton step, shortened until it stays in range and helps.
    Eigen::Vector2d step = jacobian.inverse() * residual;
    bool accepted = false;
    for (int h = 0; h < kMaxHalvings && !accepted; ++h, step *= 0.5) {
      Eigen::Vector2d next_distorted;
      Eigen::Matrix2d next_jacobian;
      accepted = Distort(camera, p + step, &next_distorted, &next_jacobian) &&
                 (target - next_distorted).squaredNorm() < residual.squaredNorm();
      if (accepted) {
        p += step;
        distorted = next_distorted;
        jacobian = next_jacobian;
      }
    }
    if (!accepted) break;
  }
  return p;
}

Eigen::Vector3d PixelRay(const Camera& camera, const Eigen::Vector2d& pixel) {
  return Undistort(camera, pixel).homogeneous().normalized();
}

Eigen::Matrix3d CameraFromRay(const Eigen::Vector3d& ray_in_camera) {
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ray_in_camera)
      .toRotationMatrix();
}

}  // namespace mpc
