#include "mpc/pose/standing_feet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

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
constexpr double kFloorSeconds = 0.4;      // that it stands on the floor whatever its estimate does
constexpr double kMaxTilt = 60 * kDegree;  // of an upright person from the picture's up
constexpr double kUprightShare = 0.1;      // of the frames that say where up is
constexpr double kStep = 0.15;             // m; stands that differ less in height are on one floor
constexpr double kFloorError = 0.015;      // m in height of a standing joint over the floor
constexpr double kGuessedFloorError = 0.05;  // the same where nothing but people says where up is
constexpr double kTurningFloorError = 0.1;   // and the camera turns as its background says
constexpr double kUnderFloor = 0.03;         // of any joint of a foot that is estimated below it
constexpr double kOwnError = 0.1;            // m along the ray of a stand on its own
constexpr double kRunaway = 0.15;     // m along the ray from where most estimates of a stand lie
constexpr double kReach = 0.05;       // m across the ray from where it began to stand
constexpr double kMoved = 0.03;       // m across the ray from where it stood that count as none
constexpr double kFloorMoved = 0.06;  // m straight along the floor that would show as more

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

// Ankles and toes of a clip, and the camera, in the base.
struct FootTracks {
  std::array<int, kFootJoints.size()> joints{};  // of the skeleton, -1: it has none
  std::array<Eigen::Matrix3Xd, kFootJoints.size()> positions;
  std::span<const Rigid<WorldFrame, CameraFrame>> base_from_camera;  // the evidence's
  std::vector<Eigen::Vector3d> upright;  // standing directions of upright frames

  // From the camera to the joint.
  Eigen::Vector3d Sight(size_t foot, int f) const {
    return positions[foot].col(f) - base_from_camera[f].translation;
  }
};

FootTracks TrackFeet(const ClipEvidence& evidence, const Eigen::MatrixXd& poses) {
  const Skeleton& skeleton = evidence.skeleton();
  FootTracks tracks;
  tracks.base_from_camera = evidence.base_from_camera();
  for (size_t i = 0; i < kFootJoints.size(); ++i) {
    tracks.joints[i] = skeleton.FindJointIndex(kFootJoints[i]);
    tracks.positions[i] = Eigen::Matrix3Xd::Zero(3, poses.cols());
  }
  KinematicState state;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    const auto& base_from_camera = tracks.base_from_camera[f];
    ForwardKinematics(skeleton, poses.col(f), &state);
    for (size_t i = 0; i < kFootJoints.size(); ++i) {
      if (tracks.joints[i] < 0) continue;
      tracks.positions[i].col(f) =
          base_from_camera * Eigen::Vector3d(state.joints.col(tracks.joints[i]));
    }
    const Eigen::Vector3d up = StandingDirection(skeleton, state);
    if (-up.y() > std::cos(kMaxTilt)) tracks.upright.push_back(base_from_camera.rotation * up);
  }
  return tracks;
}

// A joint over a range of frames.
struct Stand {
  size_t foot = 0;  // index into kFootJoints
  int begin = 0;
  int end = 0;
  Eigen::VectorXd ranges_m;  // of its frames, as their estimates together say
  bool rests = true;         // the estimate says so; else only the picture does
};

// How a joint moves around a frame, m/s.
struct Speed {
  double across = 0;  // the ray
  double along = 0;
};

// Of the line that fits the joint's positions around frame f best.
Speed SpeedAt(const FootTracks& tracks, size_t foot, int f, double fps) {
  const Eigen::Matrix3Xd& positions = tracks.positions[foot];
  const int reach = std::max(1, static_cast<int>(std::lround(0.5 * kSpeedSeconds * fps)));
  const int before = std::max(0, f - reach);
  const int count = std::min(static_cast<int>(positions.cols()), f + reach + 1) - before;
  const Eigen::VectorXd time =
      Eigen::VectorXd::LinSpaced(count, -0.5 * (count - 1), 0.5 * (count - 1)) / fps;
  const Eigen::Vector3d moved = positions.middleCols(before, count) * time / time.squaredNorm();
  const Eigen::Vector3d ray = tracks.Sight(foot, f).normalized();
  return {moved.cross(ray).norm(), std::abs(moved.dot(ray))};
}

// How far the joint in frame f lies from the ray to it in frame `begin`.
double Across(const FootTracks& tracks, size_t foot, int begin, int f) {
  const Eigen::Vector3d moved = tracks.positions[foot].col(f) - tracks.positions[foot].col(begin);
  return moved.cross(tracks.Sight(foot, begin).normalized()).norm();
}

bool IsSeen(const FrameObservation& observation, int joint) {
  return std::any_of(observation.points.begin(), observation.points.end(),
                     [&](const Observation2d& point) { return point.joint == joint; });
}

// Of a stand that has the frames in which its joint is still, the others and the ranges of all. The
// speed, which is that of a while, shows too early that a foot will move and too late that it has: it
// stands as long as it is where it stood, but not before frame `first` nor from `last` on.
void Complete(const FootTracks& tracks, const Eigen::Vector3d& up, int first, int last,
              const std::vector<FrameObservation>& observations, Stand* stand) {
  const int begin = stand->begin;
  const int end = stand->end;
  const auto& positions = tracks.positions[stand->foot];
  const Eigen::Vector3d place = positions.middleCols(begin, end - begin).rowwise().mean();
  const auto is_there = [&](int f) {
    const Eigen::Vector3d ray = tracks.Sight(stand->foot, f).normalized();
    const double most = std::min(kMoved, kFloorMoved * std::abs(up.dot(ray)));
    return IsSeen(observations[f], tracks.joints[stand->foot]) &&
           (positions.col(f) - place).cross(ray).norm() < most;
  };
  while (stand->begin > first && is_there(stand->begin - 1)) --stand->begin;
  while (stand->end < last && is_there(stand->end)) ++stand->end;

  // One place, but for a moving camera.
  const auto place_range = [&](int f) {
    return (place - tracks.base_from_camera[f].translation).norm();
  };
  Eigen::VectorXd beyond_m(end - begin);
  for (int f = begin; f < end; ++f) {
    beyond_m[f - begin] = tracks.Sight(stand->foot, f).norm() - place_range(f);
  }
  const double middle = Middle(beyond_m);
  stand->ranges_m.resize(stand->end - stand->begin);
  for (int f = stand->begin; f < stand->end; ++f) {
    stand->ranges_m[f - stand->begin] = place_range(f) + middle;
  }
}

// Of one foot, in the order of time.
std::vector<Stand> FindStands(const FootTracks& tracks, size_t foot, const Eigen::Vector3d& up,
                              double fps, const std::vector<FrameObservation>& observations) {
  const int num_frames = static_cast<int>(observations.size());
  const int least = std::max(3, static_cast<int>(std::lround(kLeastSeconds * fps)));
  std::vector<bool> rests_across;
  std::vector<bool> rests_along;
  for (int f = 0; f < num_frames; ++f) {
    const Speed speed = SpeedAt(tracks, foot, f, fps);
    const double slope = std::abs(up.dot(tracks.Sight(foot, f).normalized()));
    rests_across.push_back(IsSeen(observations[f], tracks.joints[foot]) &&
                           speed.across <= std::min(kSpeed, kFloorSpeed * slope));
    rests_along.push_back(speed.along <= kAlongSpeed);
  }
  std::vector<Stand> stands;
  for (int begin = 0; begin < num_frames;) {
    int end = begin;
    int num_resting = 0;
    for (; end < num_frames && rests_across[end] && Across(tracks, foot, begin, end) <= kReach;
         ++end) {
      num_resting += rests_along[end] ? 1 : 0;
    }
    const bool rests = num_resting >= least;
    if (rests || end - begin >= kFloorSeconds * fps) {
      stands.push_back({foot, begin, end, {}, rests});
    }
    begin = std::max(begin + 1, end);
  }
  const int most = static_cast<int>(std::lround(kSpeedSeconds * fps));
  for (size_t i = 0; i < stands.size(); ++i) {
    const int first = std::max(i > 0 ? stands[i - 1].end : 0, stands[i].begin - most);
    const int last =
        std::min(i + 1 < stands.size() ? stands[i + 1].begin : num_frames, stands[i].end + most);
    Complete(tracks, up, first, last, observations, &stands[i]);
  }
  return stands;
}

struct UpDirection {
  Eigen::Vector3d in_base = Eigen::Vector3d::Zero();  // unit; zero when hardly anybody is upright
  double floor_error = kGuessedFloorError;
};

// Up is the world's axis nearest to how people stand, else how they stand.
UpDirection EstimateUp(bool has_world, const FootTracks& tracks) {
  UpDirection up;
  const auto num_frames = static_cast<double>(tracks.positions[0].cols());
  if (static_cast<double>(tracks.upright.size()) < kUprightShare * num_frames) return up;
  for (const Eigen::Vector3d& direction : tracks.upright) up.in_base += direction;
  up.in_base.normalize();
  if (!has_world) {
    const auto& places = tracks.base_from_camera;
    const bool turns = std::any_of(places.begin(), places.end(), [&](const auto& place) {
      return place.rotation != places.front().rotation;
    });
    if (turns) up.floor_error = kTurningFloorError;
    return up;
  }
  const Eigen::Vector3d axis = SnappedToAxis(up.in_base);
  if (axis == up.in_base) return up;
  return {axis, kFloorError};
}

// Of a stand in one of its frames, along `up` in the base.
double HeightAt(const FootTracks& tracks, const Stand& stand, const Eigen::Vector3d& up, int f) {
  return up.dot(tracks.base_from_camera[f].translation +
                stand.ranges_m[f - stand.begin] * tracks.Sight(stand.foot, f).normalized());
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

// The one floor of a clip.
struct Floor {
  std::array<double, 2> heights{};  // of ankles and toes that stand on it
  double lowest = 0;                // that a toe can be
};

// nullopt when nothing rests.
std::optional<Floor> FindFloor(const FootTracks& tracks, const std::vector<Stand>& stands,
                               const std::array<double, 2>& over_toes, const Eigen::Vector3d& up) {
  std::vector<double> heights;
  std::array<double, 2> deepest{};  // of the left foot and the right
  deepest.fill(std::numeric_limits<double>::infinity());
  for (const Stand& stand : stands) {
    if (!stand.rests) continue;
    for (int f = stand.begin; f < stand.end; ++f) {
      heights.push_back(HeightAt(tracks, stand, up, f) - over_toes[stand.foot / 2]);
      deepest[stand.foot % 2] = std::min(deepest[stand.foot % 2], heights.back());
    }
  }
  if (heights.empty()) return std::nullopt;
  const double toes = Median(Eigen::VectorXd::Map(heights.data(), std::ssize(heights)));
  // Who goes down a step does so with both feet; a leg that is mirrored in depth is alone.
  const double lower = *std::max_element(deepest.begin(), deepest.end());
  return Floor{{toes + over_toes[0], toes + over_toes[1]}, lower < toes - kStep ? lower : toes};
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
  ForgetStandingFeet(observations);
  const FootTracks tracks = TrackFeet(evidence, poses);
  const auto [up, floor_error] = EstimateUp(evidence.has_world(), tracks);
  if (up.isZero()) return;  // nothing says which feet bear anybody
  std::vector<Stand> stands;
  for (size_t foot = 0; foot < kFootJoints.size(); ++foot) {
    const std::vector<Stand> its = FindStands(tracks, foot, up, evidence.fps(), *observations);
    stands.insert(stands.end(), its.begin(), its.end());
  }
  const std::optional<Floor> floor =
      FindFloor(tracks, stands, HeightsOverToes(evidence.skeleton()), up);
  if (!floor) return;
  for (const Stand& stand : stands) {
    const bool on_floor = OnFloor(tracks, stand, stands, up, floor->heights);
    if (!stand.rests && !on_floor) continue;
    for (int f = stand.begin; f < stand.end; ++f) {
      const Rigid<WorldFrame, CameraFrame>& base_from_camera = tracks.base_from_camera[f];
      const Eigen::Vector3d ray = tracks.Sight(stand.foot, f).normalized();
      const double slope = up.dot(ray);
      double range_m = stand.ranges_m[f - stand.begin];
      if (on_floor && slope < 0) {
        const double below = floor->heights[stand.foot / 2] - up.dot(base_from_camera.translation);
        const double trust = std::pow(slope * kOwnError / floor_error, 2);
        range_m = (range_m + trust * below / slope) / (1 + trust);
      }
      (*observations)[f].standing.push_back(
          {tracks.joints[stand.foot], base_from_camera.rotation.transpose() * ray, range_m, 1});
    }
  }
  const double trust = std::pow(kFloorError / std::max(floor_error, kUnderFloor), 2);
  for (size_t f = 0; f < observations->size(); ++f) {
    const Rigid<WorldFrame, CameraFrame>& base_from_camera = tracks.base_from_camera[f];
    const Eigen::Vector3d down = base_from_camera.rotation.transpose() * -up;
    const double range_m = up.dot(base_from_camera.translation) - floor->lowest;
    for (const int joint : tracks.joints) {
      if (joint >= 0) (*observations)[f].floor.push_back({joint, down, range_m, trust, true});
    }
  }
}

void ForgetStandingFeet(std::vector<FrameObservation>* observations) {
  for (FrameObservation& observation : *observations) {
    observation.standing.clear();
    observation.floor.clear();
  }
}

}  // namespace mpc
