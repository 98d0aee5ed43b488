#include "mpc/pose/standing_feet.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mpc/core/units.h"
#include "mpc/skeleton/world.h"

namespace mpc {
namespace {

constexpr std::array kFootJoints = {JointId::kLeftAnkle, JointId::kRightAnkle, JointId::kLeftToe,
                                    JointId::kRightToe};
constexpr double kSpeed = 0.15;            // m/s across the ray that count as none
constexpr double kFloorSpeed = 0.3;        // m/s straight along the floor that would show as more
constexpr double kAlongSpeed = 0.4;        // m/s along the ray, as estimated
constexpr double kSpeedSeconds = 0.3;      // over which it is taken
constexpr double kLeastSeconds = 0.25;     // that a foot stands and its estimate rests
constexpr double kMaxTilt = 60 * kDegree;  // of an upright person from the picture's up
constexpr double kUprightShare = 0.1;      // of the frames that say where up is
constexpr double kStep = 0.15;             // m; stands that differ less in height are on one floor
constexpr double kFloorError = 0.015;      // m in height of a standing joint over the floor
constexpr double kGuessedFloorError = 0.05;  // the same where nothing but people says where up is
constexpr double kOwnError = 0.1;            // m along the ray of a stand on its own
constexpr double kReach = 0.05;              // m across the ray from where it began to stand

double Median(Eigen::VectorXd values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// How far b lies from a across the ray to a.
double Across(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (b - a).cross(a.normalized()).norm();
}

// Ankles and toes of a clip, camera frame.
struct FootTracks {
  std::array<int, kFootJoints.size()> joints{};  // of the skeleton, -1: it has none
  std::array<Eigen::Matrix3Xd, kFootJoints.size()> positions;
  std::vector<Eigen::Vector3d> upright;  // standing directions of upright frames
};

FootTracks TrackFeet(const Skeleton& skeleton, const Eigen::MatrixXd& poses) {
  FootTracks tracks;
  for (size_t i = 0; i < kFootJoints.size(); ++i) {
    tracks.joints[i] = skeleton.FindJointIndex(kFootJoints[i]);
    tracks.positions[i] = Eigen::Matrix3Xd::Zero(3, poses.cols());
  }
  KinematicState state;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    ForwardKinematics(skeleton, poses.col(f), &state);
    for (size_t i = 0; i < kFootJoints.size(); ++i) {
      if (tracks.joints[i] >= 0) tracks.positions[i].col(f) = state.joints.col(tracks.joints[i]);
    }
    const Eigen::Vector3d up = StandingDirection(skeleton, state);
    if (-up.y() > std::cos(kMaxTilt)) tracks.upright.push_back(up);
  }
  return tracks;
}

// A joint over a range of frames.
struct Stand {
  size_t foot = 0;  // index into kFootJoints
  int begin = 0;
  int end = 0;
  double height = 0;         // median over at_rest, along `up` from the camera
  Eigen::Matrix3Xd at_rest;  // in those frames in which the estimate rests along the ray as well
};

// How a joint moves around a frame, m/s.
struct Speed {
  double across = 0;  // the ray
  double along = 0;
};

// Of the line that fits the joint's positions around frame f best.
Speed SpeedAt(const Eigen::Matrix3Xd& positions, int f, double fps) {
  const int reach = std::max(1, static_cast<int>(std::lround(0.5 * kSpeedSeconds * fps)));
  const int before = std::max(0, f - reach);
  const int count = std::min(static_cast<int>(positions.cols()), f + reach + 1) - before;
  const Eigen::VectorXd time =
      Eigen::VectorXd::LinSpaced(count, -0.5 * (count - 1), 0.5 * (count - 1)) / fps;
  const Eigen::Vector3d moved = positions.middleCols(before, count) * time / time.squaredNorm();
  const Eigen::Vector3d ray = positions.col(f).normalized();
  return {moved.cross(ray).norm(), std::abs(moved.dot(ray))};
}

std::vector<Stand> FindStands(const FootTracks& tracks, const Eigen::Vector3d& up, double fps,
                              const std::vector<FrameObservation>& observations) {
  const int num_frames = static_cast<int>(observations.size());
  const int least = std::max(3, static_cast<int>(std::lround(kLeastSeconds * fps)));
  std::vector<Stand> stands;
  for (size_t i = 0; i < kFootJoints.size(); ++i) {
    const Eigen::Matrix3Xd& positions = tracks.positions[i];
    std::vector<bool> rests_across;
    std::vector<bool> rests_along;
    for (int f = 0; f < num_frames; ++f) {
      const auto& points = observations[f].points;
      const bool seen = std::any_of(points.begin(), points.end(), [&](const Observation2d& point) {
        return point.joint == tracks.joints[i];
      });
      const Speed speed = SpeedAt(positions, f, fps);
      const double slope = std::abs(up.dot(positions.col(f).normalized()));
      rests_across.push_back(seen && speed.across <= std::min(kSpeed, kFloorSpeed * slope));
      rests_along.push_back(speed.along <= kAlongSpeed);
    }
    for (int begin = 0; begin < num_frames;) {
      int end = begin;
      std::vector<int> at_rest;
      while (end < num_frames && rests_across[end] &&
             Across(positions.col(begin), positions.col(end)) <= kReach) {
        if (rests_along[end]) at_rest.push_back(end);
        ++end;
      }
      if (std::ssize(at_rest) >= least) {
        const Eigen::Matrix3Xd where = positions(Eigen::all, at_rest);
        stands.push_back({i, begin, end, Median(up.transpose() * where), where});
      }
      begin = std::max(begin + 1, end);
    }
  }
  return stands;
}

struct UpDirection {
  Eigen::Vector3d in_camera = Eigen::Vector3d::Zero();  // unit; zero when hardly anybody is upright
  double floor_error = kGuessedFloorError;
};

// Up is the world's axis nearest to how people stand, else how they stand.
UpDirection EstimateUp(const Camera& camera, const FootTracks& tracks) {
  UpDirection up;
  const auto num_frames = static_cast<double>(tracks.positions[0].cols());
  if (static_cast<double>(tracks.upright.size()) < kUprightShare * num_frames) return up;
  for (const Eigen::Vector3d& direction : tracks.upright) up.in_camera += direction;
  up.in_camera.normalize();
  if (!camera.has_extrinsics) return up;
  const Eigen::Matrix3d& camera_from_world = camera.camera_from_world.rotation;
  const Eigen::Vector3d standing = camera_from_world.transpose() * up.in_camera;
  const Eigen::Vector3d axis = SnappedToAxis(standing);
  if (axis == standing) return up;
  return {camera_from_world * axis, kFloorError};
}

// Heights of the floor, as ankles and as toes have them, along `up` from the camera.
std::array<double, 2> FindFloor(const std::vector<Stand>& stands, const Eigen::Vector3d& up) {
  std::array<std::vector<double>, 2> heights;
  for (const Stand& stand : stands) {
    const Eigen::RowVectorXd more = up.transpose() * stand.at_rest;
    std::vector<double>& all = heights[stand.foot / 2];
    all.insert(all.end(), more.begin(), more.end());
  }
  std::array<double, 2> floor{};
  for (size_t kind = 0; kind < floor.size(); ++kind) {
    if (heights[kind].empty()) continue;
    floor[kind] = Median(Eigen::VectorXd::Map(heights[kind].data(), std::ssize(heights[kind])));
  }
  return floor;
}

// Whether a stand is on the floor. A foot is too short to have its toe on a step and its ankle on the
// floor: one joint says it for both.
bool OnFloor(const Stand& stand, const std::vector<Stand>& stands,
             const std::array<double, 2>& floor) {
  return std::any_of(stands.begin(), stands.end(), [&](const Stand& other) {
    const bool same_foot = other.foot % 2 == stand.foot % 2;
    const bool meanwhile = other.begin < stand.end && stand.begin < other.end;
    return same_foot && meanwhile && std::abs(other.height - floor[other.foot / 2]) < kStep;
  });
}

}  // namespace

void FindStandingFeet(const ClipEvidence& evidence, const Eigen::MatrixXd& poses,
                      std::vector<FrameObservation>* observations) {
  for (FrameObservation& observation : *observations) observation.standing.clear();
  const FootTracks tracks = TrackFeet(evidence.skeleton(), poses);
  const auto [up, floor_error] = EstimateUp(evidence.camera(), tracks);
  if (up.isZero()) return;  // nothing says which feet bear anybody
  const std::vector<Stand> stands = FindStands(tracks, up, evidence.fps(), *observations);
  const std::array<double, 2> floor = FindFloor(stands, up);
  for (const Stand& stand : stands) {
    const double own_range = Median(stand.at_rest.colwise().norm());
    const double floor_height = floor[stand.foot / 2];
    const bool on_floor = OnFloor(stand, stands, floor);
    for (int f = stand.begin; f < stand.end; ++f) {
      const Eigen::Vector3d ray = tracks.positions[stand.foot].col(f).normalized();
      const double slope = up.dot(ray);
      double range_m = own_range;
      if (on_floor && slope < 0) {
        const double trust = std::pow(slope * kOwnError / floor_error, 2);
        range_m = (own_range + trust * floor_height / slope) / (1 + trust);
      }
      (*observations)[f].standing.push_back({tracks.joints[stand.foot], ray, range_m, 1});
    }
  }
}

}  // namespace mpc
