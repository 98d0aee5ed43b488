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
constexpr double kRunaway = 0.15;  // m along the ray from where most estimates of a stand lie
constexpr double kReach = 0.05;    // m across the ray from where it began to stand

double Median(Eigen::VectorXd values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Where most of the values lie: a limb that runs away for a part of the time does not move it.
double Middle(const Eigen::VectorXd& values) {
  double middle = Median(values);
  for (int i = 0; i < 10; ++i) {
    const Eigen::ArrayXd weights =
        (1 + ((values.array() - middle) / kRunaway).square()).square().inverse();
    middle = (weights * values.array()).sum() / weights.sum();
  }
  return middle;
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
  double range_m = 0;  // as the estimates of its frames say
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
      int num_resting = 0;
      for (; end < num_frames && rests_across[end] &&
             Across(positions.col(begin), positions.col(end)) <= kReach;
           ++end) {
        num_resting += rests_along[end] ? 1 : 0;
      }
      if (num_resting >= least) {
        const Eigen::VectorXd ranges =
            positions.middleCols(begin, end - begin).colwise().norm().transpose();
        stands.push_back({i, begin, end, Middle(ranges)});
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

// Of a stand in one of its frames, along `up` from the camera.
double HeightAt(const FootTracks& tracks, const Stand& stand, const Eigen::Vector3d& up, int f) {
  return stand.range_m * up.dot(tracks.positions[stand.foot].col(f).normalized());
}

// How much higher an ankle is than the toe of a foot that stands flat, as at rest; 0 for toes.
std::array<double, 2> HeightsOverToes(const Skeleton& skeleton) {
  KinematicState state;
  ForwardKinematics(skeleton, Eigen::VectorXd::Zero(skeleton.num_dofs()), &state);
  const Eigen::Vector3d up = StandingDirection(skeleton, state);
  double sum = 0;
  int num_feet = 0;
  for (size_t ankle = 0; ankle < 2; ++ankle) {
    const int a = skeleton.FindJointIndex(kFootJoints[ankle]);
    const int t = skeleton.FindJointIndex(kFootJoints[ankle + 2]);
    if (a < 0 || t < 0) continue;
    sum += up.dot(state.joints.col(a) - state.joints.col(t));
    ++num_feet;
  }
  return {num_feet > 0 ? sum / num_feet : 0, 0};
}

// Heights of ankles and toes that stand on the one floor of the clip.
std::array<double, 2> FindFloor(const FootTracks& tracks, const std::vector<Stand>& stands,
                                const std::array<double, 2>& over_toes, const Eigen::Vector3d& up) {
  std::vector<double> heights;
  for (const Stand& stand : stands) {
    for (int f = stand.begin; f < stand.end; ++f) {
      heights.push_back(HeightAt(tracks, stand, up, f) - over_toes[stand.foot / 2]);
    }
  }
  if (heights.empty()) return {};
  const double toes = Median(Eigen::VectorXd::Map(heights.data(), std::ssize(heights)));
  return {toes + over_toes[0], toes + over_toes[1]};
}

// Whether a stand is on the floor. A foot is too short to have its toe on a step and its ankle on the
// floor: one joint says it for both.
bool OnFloor(const FootTracks& tracks, const Stand& stand, const std::vector<Stand>& stands,
             const Eigen::Vector3d& up, const std::array<double, 2>& floor) {
  return std::any_of(stands.begin(), stands.end(), [&](const Stand& other) {
    const bool same_foot = other.foot % 2 == stand.foot % 2;
    const bool meanwhile = other.begin < stand.end && stand.begin < other.end;
    if (!same_foot || !meanwhile) return false;
    const double height = HeightAt(tracks, other, up, (other.begin + other.end) / 2);
    return std::abs(height - floor[other.foot / 2]) < kStep;
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
  const std::array<double, 2> floor =
      FindFloor(tracks, stands, HeightsOverToes(evidence.skeleton()), up);
  for (const Stand& stand : stands) {
    const double floor_height = floor[stand.foot / 2];
    const bool on_floor = OnFloor(tracks, stand, stands, up, floor);
    for (int f = stand.begin; f < stand.end; ++f) {
      const Eigen::Vector3d ray = tracks.positions[stand.foot].col(f).normalized();
      const double slope = up.dot(ray);
      double range_m = stand.range_m;
      if (on_floor && slope < 0) {
        const double trust = std::pow(slope * kOwnError / floor_error, 2);
        range_m = (stand.range_m + trust * floor_height / slope) / (1 + trust);
      }
      (*observations)[f].standing.push_back({tracks.joints[stand.foot], ray, range_m, 1});
    }
  }
}

}  // namespace mpc
