#include "mpc/pose/standing_feet.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mpc/core/units.h"

namespace mpc {
namespace {

constexpr std::array kFootJoints = {JointId::kLeftAnkle, JointId::kRightAnkle, JointId::kLeftToe,
                                    JointId::kRightToe};
constexpr double kSpeed = 0.2;          // m/s across the ray that count as none
constexpr double kSpeedSeconds = 0.1;   // over which it is taken
constexpr double kLeastSeconds = 0.25;  // that a foot stands
constexpr double kSnapAngle = 25 * kDegree;
static const double kStep = getenv("ST")?atof(getenv("ST")):0.15;           // m; stands that differ less in height are on one floor
static const double kFloorError = getenv("FE")?atof(getenv("FE")):0.015;    // m in height of a standing joint over the floor
constexpr double kOwnError = 0.1;       // m along the ray of a stand on its own
constexpr double kReach = 0.05;         // m across the ray from where it began to stand

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// How far b lies from a across the ray to a.
double Across(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (b - a).cross(a.normalized()).norm();
}

// A joint of one frame range.
struct Stand {
  size_t foot = 0;  // index into kFootJoints
  int begin = 0;
  int end = 0;
};

// Up in the camera's frame: of the world's axes the nearest to where people stand, else that.
Eigen::Vector3d EstimateUp(const Camera& camera, const Eigen::Matrix3Xd& standing) {
  Eigen::Vector3d up;
  for (int k = 0; k < 3; ++k) {
    const Eigen::VectorXd row = standing.row(k);
    up[k] = Median({row.begin(), row.end()});
  }
  up.normalize();
  if (!camera.has_extrinsics) return up;
  const Eigen::Vector3d in_world = camera.camera_from_world.rotation.transpose() * up;
  Eigen::Index axis = 0;
  in_world.cwiseAbs().maxCoeff(&axis);
  if (std::abs(in_world[axis]) < std::cos(kSnapAngle)) return up;
  return std::copysign(1.0, in_world[axis]) * camera.camera_from_world.rotation.col(axis);
}

}  // namespace

void FindStandingFeet(const ClipEvidence& evidence, const Eigen::MatrixXd& poses,
                      std::vector<FrameObservation>* observations) {
  const Skeleton& skeleton = evidence.skeleton();
  const int num_frames = static_cast<int>(poses.cols());
  const double fps = evidence.fps();
  const int reach = std::max(1, static_cast<int>(std::lround(0.5 * kSpeedSeconds * fps)));
  const int least = std::max(3, static_cast<int>(std::lround(kLeastSeconds * fps)));
  std::array<Eigen::Matrix3Xd, kFootJoints.size()> tracks;
  std::array<int, kFootJoints.size()> joints{};
  for (size_t i = 0; i < kFootJoints.size(); ++i) {
    joints[i] = skeleton.FindJointIndex(kFootJoints[i]);
    tracks[i].resize(3, num_frames);
  }
  Eigen::Matrix3Xd standing(3, num_frames);  // directions from the feet to the trunk
  KinematicState state;
  const int pelvis = skeleton.FindJointIndex(JointId::kPelvis);
  for (int f = 0; f < num_frames; ++f) {
    (*observations)[f].standing.clear();
    ForwardKinematics(skeleton, poses.col(f), &state);
    for (size_t i = 0; i < joints.size(); ++i) {
      if (joints[i] >= 0) tracks[i].col(f) = state.joints.col(joints[i]);
    }
    const Eigen::Vector3d trunk = pelvis >= 0 ? state.joints.col(pelvis) : state.origins.col(0);
    standing.col(f) = (trunk - 0.5 * (tracks[0].col(f) + tracks[1].col(f))).normalized();
  }
  std::vector<Stand> stands;
  for (size_t i = 0; i < joints.size(); ++i) {
    if (joints[i] < 0) continue;
    const Eigen::Matrix3Xd& track = tracks[i];
    const auto rests = [&](int f) {
      const int before = std::max(0, f - reach);
      const int after = std::min(num_frames - 1, f + reach);
      const auto& points = (*observations)[f].points;
      const bool seen = std::any_of(points.begin(), points.end(), [&](const Observation2d& point) {
        return point.joint == joints[i];
      });
      return seen && Across(track.col(before), track.col(after)) * fps <= kSpeed * (after - before);
    };
    for (int begin = 0; begin < num_frames;) {
      int end = begin;
      while (end < num_frames && rests(end) && Across(track.col(begin), track.col(end)) <= kReach) {
        ++end;
      }
      if (end - begin >= least) stands.push_back({i, begin, end});
      begin = std::max(begin + 1, end);
    }
  }
  if (stands.empty()) return;

  // The floor under ankles and under toes.
  const Eigen::Vector3d up = EstimateUp(evidence.camera(), standing);
  std::array<double, 2> floor{};
  for (size_t kind = 0; kind < floor.size(); ++kind) {
    std::vector<double> heights;
    for (const Stand& stand : stands) {
      for (int f = stand.begin; stand.foot / 2 == kind && f < stand.end; ++f) {
        heights.push_back(up.dot(tracks[stand.foot].col(f)));
      }
    }
    if (!heights.empty()) floor[kind] = Median(std::move(heights));
  }
  for (const Stand& stand : stands) {
    const Eigen::Matrix3Xd& track = tracks[stand.foot];
    std::vector<double> ranges;
    std::vector<double> heights;
    for (int f = stand.begin; f < stand.end; ++f) {
      ranges.push_back(track.col(f).norm());
      heights.push_back(up.dot(track.col(f)));
    }
    const double own_range = Median(std::move(ranges));
    const bool on_floor = std::abs(Median(std::move(heights)) - floor[stand.foot / 2]) < kStep;
    for (int f = stand.begin; f < stand.end; ++f) {
      const Eigen::Vector3d ray = track.col(f).normalized();
      const double slope = up.dot(ray);
      double range_m = own_range;
      if (on_floor && slope < 0) {
        const double trust = std::pow(slope * kOwnError / kFloorError, 2);
        range_m = (own_range + trust * floor[stand.foot / 2] / slope) / (1 + trust);
      }
      (*observations)[f].standing.push_back({joints[stand.foot], ray, range_m, 1});
    }
  }
}

}  // namespace mpc
