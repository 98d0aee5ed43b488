#include "mpc/eval/synthetic_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "mpc/core/error.h"
#include "mpc/core/units.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr double kPitchRad = 10 * kDegree;
constexpr double kFreeMargin = 0.45;  // half of the part of the picture that the actor may fill
constexpr double kFollowS = 0.8;      // how slowly a camera follows: half width of the mean
constexpr int kPointsPerFrame = 200;  // of the actor's vertices, to see whether it fits
constexpr double kShakeRad = 0.4 * kDegree;  // root mean square per axis
constexpr double kShakeM = 0.015;

// A smooth, band-limited function of time: 0.2 to 2.5 Hz, slow parts larger, root mean square 1.
class Wobble {
 public:
  explicit Wobble(std::mt19937_64* random) {
    std::uniform_real_distribution<double> uniform(0, 1);
    double power = 0;
    for (size_t i = 0; i < kWaves; ++i) {
      const double hz = 0.2 * std::pow(12.5, (static_cast<double>(i) + uniform(*random)) / kWaves);
      waves_[i] = {2 * std::numbers::pi * hz, 2 * std::numbers::pi * uniform(*random), 1 / hz};
      power += 0.5 / (hz * hz);
    }
    for (Wave& wave : waves_) wave.size /= std::sqrt(power);
  }
  double At(double seconds) const {
    double sum = 0;
    for (const Wave& wave : waves_) sum += wave.size * std::sin(wave.omega * seconds + wave.phase);
    return sum;
  }

 private:
  struct Wave {
    double omega, phase, size;
  };
  static constexpr size_t kWaves = 8;
  std::array<Wave, kWaves> waves_;
};

// Mean over frames [f - reach, f + reach] of the columns, weights falling to zero as a cosine.
Eigen::Matrix3Xd Smoothed(const Eigen::Matrix3Xd& path, int reach) {
  Eigen::Matrix3Xd smooth(3, path.cols());
  for (Eigen::Index f = 0; f < path.cols(); ++f) {
    Vector3d sum = Vector3d::Zero();
    double total = 0;
    for (int k = -reach; k <= reach; ++k) {
      const double weight = 1 + std::cos(std::numbers::pi * k / (reach + 1));
      sum += weight * path.col(std::clamp<Eigen::Index>(f + k, 0, path.cols() - 1));
      total += weight;
    }
    smooth.col(f) = sum / total;
  }
  return smooth;
}

// x right, y down, z along `forward`, no roll.
Eigen::Matrix3d Looking(const Vector3d& forward) {
  Eigen::Matrix3d rotation;
  rotation.row(2) = forward.normalized();
  rotation.row(0) = Vector3d::UnitY().cross(Vector3d(-forward)).normalized();
  rotation.row(1) = rotation.row(2).cross(rotation.row(0));
  return rotation;
}

// The whole actor in few points per frame.
std::vector<Eigen::Matrix3Xf> Thinned(const std::vector<Eigen::Matrix3Xf>& vertices) {
  std::vector<Eigen::Matrix3Xf> points;
  for (const Eigen::Matrix3Xf& all : vertices) {
    const auto step = std::max<Eigen::Index>(1, all.cols() / kPointsPerFrame);
    Eigen::Matrix3Xf some(3, (all.cols() + step - 1) / step + 6);
    Eigen::Index n = 0;
    for (Eigen::Index v = 0; v < all.cols(); v += step) some.col(n++) = all.col(v);
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Index least = 0, most = 0;
      all.row(axis).minCoeff(&least);
      all.row(axis).maxCoeff(&most);
      some.col(n++) = all.col(least);
      some.col(n++) = all.col(most);
    }
    points.push_back(some);
  }
  return points;
}

bool Fits(const Camera& camera, const CameraFromWorld& pose, const Eigen::Matrix3Xf& points) {
  for (const auto& x : points.colwise()) {
    Eigen::Vector2d pixel;
    if (!Project(camera, pose * x.cast<double>(), &pixel)) return false;
    if (std::abs((pixel.x() + 0.5) / camera.width - 0.5) > kFreeMargin) return false;
    if (std::abs((pixel.y() + 0.5) / camera.height - 0.5) > kFreeMargin) return false;
  }
  return true;
}

// Where the camera is and looks, up to its distance.
struct Path {
  Eigen::Matrix3Xd stands;  // the camera stands at `distance` from here
  Eigen::Matrix3Xd aims;    // and looks here
  Eigen::Matrix3Xd shift;   // the hand's trembling, m and rad, in the camera
  Eigen::Matrix3Xd turn;
};

Path MakePath(const std::vector<Eigen::Matrix3Xf>& points, double fps,
              const SyntheticCameraOptions& options) {
  const auto num_frames = static_cast<Eigen::Index>(points.size());
  Eigen::Matrix3Xd centres(3, num_frames);
  Vector3d least = Vector3d::Constant(1e9), most = -least;
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    const Vector3d low = points[f].rowwise().minCoeff().cast<double>();
    const Vector3d high = points[f].rowwise().maxCoeff().cast<double>();
    centres.col(f) = (low + high) / 2;
    least = least.cwiseMin(low);
    most = most.cwiseMax(high);
  }
  const int reach = static_cast<int>(std::ceil(kFollowS * fps));
  Path path;
  path.stands = ((least + most) / 2).replicate(1, num_frames);
  path.aims = path.stands;
  if (options.motion != CameraMotion::kStatic) path.aims = Smoothed(centres, reach);
  path.shift = path.turn = Eigen::Matrix3Xd::Zero(3, num_frames);
  if (options.motion != CameraMotion::kHandheld) return path;
  path.stands = Smoothed(path.aims, reach);
  path.stands.row(1).setConstant(path.stands.row(1).mean());
  std::mt19937_64 random(options.seed);
  for (int axis = 0; axis < 3; ++axis) {
    const Wobble shift(&random), turn(&random);
    const double roll = axis == 2 ? 0.5 : 1;
    for (Eigen::Index f = 0; f < num_frames; ++f) {
      const double seconds = static_cast<double>(f) / fps;
      path.shift(axis, f) = options.shake * kShakeM * shift.At(seconds);
      path.turn(axis, f) = options.shake * kShakeRad * roll * turn.At(seconds);
    }
  }
  return path;
}

CameraFromWorld PoseAt(const Path& path, Eigen::Index frame, double distance) {
  const Vector3d back(0, std::sin(kPitchRad), std::cos(kPitchRad));
  const Vector3d eye = path.stands.col(frame) + distance * back;
  CameraFromWorld pose;
  pose.rotation = ExpSO3(path.turn.col(frame)) * Looking(path.aims.col(frame) - eye);
  pose.translation = path.shift.col(frame) - pose.rotation * eye;
  return pose;
}

}  // namespace

std::string_view CameraMotionName(CameraMotion motion) {
  switch (motion) {
    case CameraMotion::kStatic:
      return "static";
    case CameraMotion::kPan:
      return "pan";
    case CameraMotion::kHandheld:
      return "handheld";
  }
  return "";
}

void SyntheticCameraOptions::Validate() const {
  std::string faults;
  const auto check = [&](const char* name, double value, double least, double most) {
    if (value >= least && value <= most) return;
    faults += fmt::format("{}{} is {}, expected {} to {}", faults.empty() ? "" : "; ", name, value,
                          least, most);
  };
  check("width", width, 16, 4096);
  check("height", height, 16, 4096);
  check("fov_rad", fov_rad, 9.999 * kDegree, 120.001 * kDegree);
  check("shake", shake, 0, 10);
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "synthetic camera: " + faults);
}

Camera SyntheticCamera::InFrame(int frame) const {
  Camera in_frame = camera;
  in_frame.camera_from_world = At(frame);
  return in_frame;
}

SyntheticCamera MakeSyntheticCamera(const std::vector<Eigen::Matrix3Xf>& vertices, double fps,
                                    const SyntheticCameraOptions& options) {
  options.Validate();
  if (vertices.empty() || vertices.front().cols() == 0 || !(fps > 0)) {
    throw Error(ErrorCode::kInvalidArgument, "a synthetic camera needs an actor to look at");
  }
  SyntheticCamera result;
  result.camera = Camera::FromFov(options.width, options.height, options.fov_rad);
  result.camera.name = "synth";
  result.camera.has_extrinsics = true;
  const std::vector<Eigen::Matrix3Xf> points = Thinned(vertices);
  const Path path = MakePath(points, fps, options);
  double distance = 0.5;
  for (size_t f = 0; f < points.size();) {
    if (!Fits(result.camera, PoseAt(path, static_cast<Eigen::Index>(f), distance), points[f])) {
      distance *= 1.02;
      f = 0;
      if (distance > 1e4) {
        throw Error(ErrorCode::kInvalidArgument,
                    "the actor fits into no picture: it is not finite");
      }
    } else {
      ++f;
    }
  }
  if (options.motion != CameraMotion::kStatic) {
    for (Eigen::Index f = 0; f < path.stands.cols(); ++f) {
      result.motion.push_back(PoseAt(path, f, distance));
    }
  }
  result.camera.camera_from_world = PoseAt(path, 0, distance);
  return result;
}

}  // namespace mpc
