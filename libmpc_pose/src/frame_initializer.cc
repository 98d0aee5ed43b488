#include "mpc/pose/frame_initializer.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/pose/windows.h"
#include "translation_fit.h"

namespace mpc {
namespace {

constexpr int kMinPoints = 4;
constexpr double kMaxTrackedGapSeconds = 0.2;  // the previous pose is still a start after it
constexpr double kCheckSeconds = 0.25;         // between two starts that ignore the neighbour
constexpr int kNumSeeds = 12;                  // frames tried as the one to start from
// A start fits when its cost is at most this factor above the typical cost of the clip so far.
constexpr double kGoodFactor = 2.5;
// Robust scales are narrowed in steps (graduated non-convexity): a factor of the final ones.
constexpr double kWideLoss = 3;
constexpr double kSamePose = 0.03;  // m between joints of poses that are the same
constexpr double kCrouch = 1.4;     // rad; a start for people who sit or squat
// Exchanged sides, or a jump to another facing, must explain the frame this much better.
constexpr double kJumpPenalty = 1.5;
// Speeds a tracked pose may change with, at the price of one typical detection error (20 mm).
constexpr double kTrackSpeed = 1.5;                // m/s
constexpr double kTrackTurnSpeed = 4;              // rad/s
constexpr double kMaxTrackCost = 60 * kNoiseCost;  // a jump costs no more than this

// Pelvis orientation of the 3D detection: left from hips and shoulders, up towards the shoulders.
std::optional<Eigen::Matrix3d> TorsoRotation(const ClipEvidence& evidence,
                                             const FrameObservation& observation) {
  const auto vector = [&](JointId a, JointId b) -> const Eigen::Vector3d* {
    for (size_t i = 0; i < observation.bone.size(); ++i) {
      const EvidenceBone& bone = evidence.bones()[observation.bone[i]];
      if (evidence.skeleton().joints[bone.a].id == a &&
          evidence.skeleton().joints[bone.b].id == b) {
        return &observation.bone_vector[i];
      }
    }
    return nullptr;
  };
  const Eigen::Vector3d* hips = vector(JointId::kLeftHip, JointId::kRightHip);
  const Eigen::Vector3d* shoulders = vector(JointId::kLeftShoulder, JointId::kRightShoulder);
  const Eigen::Vector3d* left_up = vector(JointId::kPelvis, JointId::kLeftShoulder);
  const Eigen::Vector3d* right_up = vector(JointId::kPelvis, JointId::kRightShoulder);
  if (left_up == nullptr || right_up == nullptr) return std::nullopt;
  Eigen::Vector3d left = Eigen::Vector3d::Zero();
  if (hips != nullptr) left -= hips->normalized();
  if (shoulders != nullptr) left -= shoulders->normalized();
  const Eigen::Vector3d up = (*left_up + *right_up).normalized();
  left -= left.dot(up) * up;
  if (left.norm() < 0.1) return std::nullopt;
  left.normalize();
  Eigen::Matrix3d rotation;
  rotation << left, up, left.cross(up);
  return rotation;
}

// Where the root of a posed skeleton must be to project onto the 2D points: linear least squares.
Eigen::Vector3d FitRootTranslation(const ClipEvidence& evidence,
                                   const FrameObservation& observation, Eigen::VectorXd pose) {
  pose.head<3>().setZero();
  KinematicState state;
  ForwardKinematics(evidence.skeleton(), pose, &state);
  TranslationFit fit;
  for (const Observation2d& point : observation.points) {
    fit.Add(state.joints.col(point.joint), Undistort(evidence.camera(), point.pixel), point.weight);
  }
  Eigen::Vector3d translation = fit.Solve();
  if (translation.allFinite() && translation.z() > 0.3) return translation;
  const Eigen::Vector3d ray = observation.camera_from_ray.col(2);
  return ray * (3.0 / std::max(0.1, ray.z()));
}

// Ties a pose to its neighbour's, some time away.
TrackPriorEnergy TrackPrior(const Eigen::VectorXd& neighbour, double seconds) {
  const double step = kTrackSpeed * seconds;
  const double turn = kTrackTurnSpeed * seconds;
  return {neighbour, kNoiseCost / (step * step), kNoiseCost / (turn * turn)};
}

// The best solution of one frame over several starts.
class FrameSearch {
 public:
  explicit FrameSearch(const ClipEvidence& evidence)
      : evidence_(evidence), relaxed_(RelaxedPose(evidence.skeleton())), crouched_(relaxed_) {
    for (size_t h = 0; h < evidence.skeleton().hinges.size(); ++h) {
      const Hinge& hinge = evidence.skeleton().hinges[h];
      const bool bends =
          hinge.name.ends_with("hip_flexion") || hinge.name.ends_with("knee_flexion");
      if (bends) crouched_[6 + h] = std::clamp(kCrouch, hinge.min_rad, hinge.max_rad);
    }
  }

  // Forgets the candidates; from now on they also compete by their distance from a neighbour.
  void Reset(const TrackPriorEnergy& prior = {}) {
    cost = std::numeric_limits<double>::infinity();
    prior_ = prior;
  }

  void FromNeighbour(const FrameObservation& observation, SideSwap side_swap,
                     const Eigen::VectorXd& neighbour) {
    Eigen::VectorXd candidate = neighbour;
    Solve(observation, 1, prior_, &candidate);
    Keep(observation, side_swap, side_swap == SideSwap::kNone ? 1 : kJumpPenalty, candidate);
  }

  // From afar a narrow robust loss would see nothing but outliers: plain squares lead the way. A start
  // that they lead where an earlier one was is given up.
  void FromPose(const FrameObservation& observation, SideSwap side_swap, double penalty,
                const Eigen::VectorXd& start) {
    Eigen::VectorXd candidate = start;
    Solve(observation, 0, {}, &candidate);
    if (IsKnown(scratch_.current.state.joints)) return;
    for (const double loss_width : {kWideLoss, 1.0}) {
      Solve(observation, loss_width, {}, &candidate);
    }
    Keep(observation, side_swap, penalty, candidate);
  }

  // Starts that ignore the neighbour; they do not pay for the way from it either.
  void FromFacings(const FrameObservation& observation, double penalty) {
    prior_ = {};
    led_to_.clear();
    std::vector<Eigen::Matrix3d> facings;
    if (observation.use_3d) {
      if (const auto torso = TorsoRotation(evidence_, observation)) facings.push_back(*torso);
    }
    if (facings.empty()) {
      // Upright (the camera's y points down), facing four ways.
      const Eigen::AngleAxisd upright(std::numbers::pi, Eigen::Vector3d::UnitX());
      for (int quarter = 0; quarter < 4; ++quarter) {
        const Eigen::AngleAxisd turn(quarter * std::numbers::pi / 2, Eigen::Vector3d::UnitY());
        facings.push_back((upright * turn).toRotationMatrix());
      }
    }
    for (const Eigen::Matrix3d& facing : facings) {
      for (Eigen::VectorXd start : {relaxed_, ZeroPose(evidence_.skeleton()), crouched_}) {
        start.segment<3>(3) = LogSO3(facing);
        start.head<3>() = FitRootTranslation(evidence_, observation, start);
        FromPose(observation, SideSwap::kNone, penalty, start);
      }
    }
  }

  double cost = std::numeric_limits<double>::infinity();
  Eigen::VectorXd pose;
  SideSwap swap = SideSwap::kNone;

 private:
  FrameProblem Problem(const FrameObservation& observation, double loss_width,
                       const Eigen::VectorXd& candidate) const {
    return evidence_.MakeProblem(observation, PersonDepth(candidate), loss_width, relaxed_);
  }

  void Solve(const FrameObservation& observation, double loss_width, const TrackPriorEnergy& prior,
             Eigen::VectorXd* candidate) {
    FrameProblem problem = Problem(observation, loss_width, *candidate);
    problem.track_prior = prior;
    SolveFrame(evidence_.skeleton(), problem, evidence_.options().frame_solver, candidate,
               &scratch_);
  }

  bool IsKnown(const Eigen::Matrix3Xd& joints) {
    for (const Eigen::Matrix3Xd& other : led_to_) {
      if ((joints - other).colwise().norm().maxCoeff() < kSamePose) return true;
    }
    led_to_.push_back(joints);
    return false;
  }

  void Keep(const FrameObservation& observation, SideSwap side_swap, double penalty,
            const Eigen::VectorXd& candidate) {
    PosePoint& point = scratch_.current;
    point.pose = candidate;
    point.root_rotation = ExpSO3(candidate.segment<3>(3));
    point.Update(evidence_.skeleton(), /*with_jacobian=*/false);
    FrameProblem tracking;
    tracking.track_prior = prior_;
    const double candidate_cost =
        penalty * EvaluateFrame(Problem(observation, 1, candidate), point, &scratch_.evaluation) +
        std::min(kMaxTrackCost, EvaluateFrame(tracking, point, &scratch_.evaluation));
    if (candidate_cost >= cost) return;
    cost = candidate_cost;
    pose = candidate;
    swap = side_swap;
  }

  const ClipEvidence& evidence_;
  Eigen::VectorXd relaxed_;
  Eigen::VectorXd crouched_;
  TrackPriorEnergy prior_;
  std::vector<Eigen::Matrix3Xd> led_to_;  // joints where this frame's starts were led so far
  FrameSolveScratch scratch_;
};

// Frames that were not solved: between their neighbours, or as the nearest one at the ends.
void FillGaps(const std::vector<bool>& observed, Eigen::MatrixXd* poses) {
  const int num_frames = static_cast<int>(poses->cols());
  int last = -1;
  for (int f = 0; f < num_frames; ++f) {
    if (!observed[f]) continue;
    for (int g = last + 1; g < f; ++g) {
      const double w = last < 0 ? 1.0 : static_cast<double>(g - last) / (f - last);
      poses->col(g) = BlendPoses(poses->col(std::max(last, 0)), poses->col(f), w);
    }
    last = f;
  }
  for (int g = last + 1; g < num_frames; ++g) poses->col(g) = poses->col(last);
}

// Solves the frames of a clip one after the other.
class FrameTracker {
 public:
  FrameTracker(const ClipEvidence& evidence, const ProgressCallback& progress)
      : evidence_(evidence),
        progress_(progress),
        search_(evidence),
        max_gap_(std::max(2, Frames(kMaxTrackedGapSeconds))),
        check_every_(std::max(1, Frames(kCheckSeconds))),
        costs_(evidence.num_frames(), std::numeric_limits<double>::infinity()) {
    const int num_frames = evidence.num_frames();
    result.poses.setZero(evidence.skeleton().num_dofs(), num_frames);
    result.swaps.assign(num_frames, SideSwap::kNone);
    result.observed.assign(num_frames, false);
    for (int f = 0; f < num_frames; ++f) {
      result.observations.push_back(evidence.Observe(f));
      if (static_cast<int>(result.observations[f].points.size()) >= kMinPoints) {
        usable_.push_back(f);
      }
    }
  }

  // Solves the frame to start from: the best explained per observation of a few spread over the
  // clip. Returns its position among the usable frames, -1 when there are none.
  int SolveSeed() {
    int seed = -1;
    double seed_cost = std::numeric_limits<double>::infinity();
    const int num_seeds = std::min<int>(kNumSeeds, static_cast<int>(usable_.size()));
    for (int i = 0; i < num_seeds; ++i) {
      const int position = static_cast<int>(static_cast<size_t>(i) * usable_.size() /
                                            static_cast<size_t>(num_seeds));
      const FrameObservation& observation = result.observations[usable_[position]];
      search_.Reset();
      search_.FromFacings(observation, 1);
      const double count = static_cast<double>(observation.points.size() +
                                               (observation.use_3d ? observation.bone.size() : 0));
      if (search_.cost / (count * count) >= seed_cost) continue;
      seed_cost = search_.cost / (count * count);
      seed = position;
    }
    if (seed < 0) return -1;
    search_.Reset();
    search_.FromFacings(result.observations[usable_[seed]], 1);
    Accept(usable_[seed]);
    return seed;
  }

  // Solves the usable frames beyond the seed, forwards (1) or backwards (-1).
  void Follow(int seed, int direction) {
    int previous = usable_[seed];
    int unchecked = 0;
    for (int i = seed + direction; IsUsable(i) && !result.cancelled; i += direction) {
      const int f = usable_[i];
      result.cancelled = !ReportVisit();
      const bool near = std::abs(f - previous) <= max_gap_;
      FrameObservation seen = result.observations[f];
      search_.Reset();
      if (near) {
        seen = StartNear(f, previous);
        if (!Fits()) TrySwaps(f, previous, seen);
      }
      const double tracked_cost = search_.cost;
      if (!Fits() || ++unchecked >= check_every_) {
        unchecked = 0;
        search_.FromFacings(seen, near ? kJumpPenalty : 1);
      }
      if (!std::isfinite(search_.cost)) continue;
      const bool started_anew = search_.cost < tracked_cost;
      Accept(f);
      previous = f;
      if (near && started_anew) FollowBack(i, direction);
    }
  }

  FrameInitialization result;

 private:
  int Frames(double seconds) const {
    return static_cast<int>(std::lround(seconds * evidence_.fps()));
  }

  // False when the work is to stop.
  bool ReportVisit() {
    ++num_visited_;
    return !progress_ || progress_({"start", num_visited_, static_cast<int>(usable_.size())});
  }

  bool IsUsable(int i) const { return i >= 0 && i < static_cast<int>(usable_.size()); }

  bool Fits() const {
    return num_solved_ >= 5 && search_.cost <= kGoodFactor * cost_sum_ / num_solved_;
  }

  void Accept(int f) {
    costs_[f] = search_.cost;
    cost_sum_ += search_.cost;
    ++num_solved_;
    result.poses.col(f) = search_.pose;
    result.swaps[f] = search_.swap;
    result.observed[f] = true;
    const Eigen::Vector3d hips = search_.pose.head<3>();
    result.observations[f] = evidence_.Observe(f, search_.swap, &hips);
  }

  // Tracks a frame from its neighbour. Returns what it shows from there.
  FrameObservation StartNear(int f, int neighbour) {
    const Eigen::VectorXd start = result.poses.col(neighbour);
    const Eigen::Vector3d hips = start.head<3>();
    FrameObservation seen = evidence_.Observe(f, SideSwap::kNone, &hips);
    search_.Reset(TrackPrior(start, std::abs(f - neighbour) / evidence_.fps()));
    search_.FromNeighbour(seen, SideSwap::kNone, start);
    return seen;
  }

  // When 2D and 3D contradict each other but agree after exchanging one of them, one is wrong; else
  // both are or none is.
  void TrySwaps(int f, int neighbour, const FrameObservation& seen) {
    const Eigen::VectorXd start = result.poses.col(neighbour);
    const Eigen::Vector3d hips = start.head<3>();
    const auto attempt = [&](SideSwap swap) {
      search_.FromNeighbour(evidence_.Observe(f, swap, &hips), swap, start);
    };
    const FrameObservation exchanged = evidence_.Observe(f, SideSwap::k2d, &hips);
    if (exchanged.use_3d && exchanged.pck < 0.5 * seen.pck) {
      attempt(SideSwap::k2d);
      attempt(SideSwap::k3d);
    } else {
      attempt(SideSwap::kBoth);
    }
  }

  // A frame that starts anew with success shows that the frames before it were wrong: they are
  // tracked again from it, as far as that explains them better.
  void FollowBack(int i, int direction) {
    for (int k = i - direction; IsUsable(k); k -= direction) {
      const int f = usable_[k];
      const int from = usable_[k + direction];
      if (std::abs(f - from) > max_gap_ || !result.observed[from]) return;
      StartNear(f, from);
      if (search_.cost >= costs_[f]) return;
      Accept(f);
    }
  }

  const ClipEvidence& evidence_;
  const ProgressCallback& progress_;
  FrameSearch search_;
  int max_gap_;
  int check_every_;
  std::vector<int> usable_;    // frames with enough points
  std::vector<double> costs_;  // per frame
  double cost_sum_ = 0;
  int num_solved_ = 0;
  int num_visited_ = 1;  // with the seed
};

}  // namespace

double PersonDepth(const Eigen::VectorXd& pose) { return std::max(0.1, pose[2]); }

FrameInitialization InitializeFrames(const ClipEvidence& evidence,
                                     const ProgressCallback& progress) {
  FrameTracker tracker(evidence, progress);
  const int seed = tracker.SolveSeed();
  if (seed < 0) {
    throw Error(ErrorCode::kMismatch,
                "no frame has enough 2D detections of a person (4 joints with confidence above 0)");
  }
  tracker.Follow(seed, 1);
  tracker.Follow(seed, -1);
  FillGaps(tracker.result.observed, &tracker.result.poses);
  return std::move(tracker.result);
}

}  // namespace mpc
