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

namespace mpc {
namespace {

constexpr int kMinPoints = 4;
constexpr int kMaxTrackedGap = 5;  // frames across which the previous pose is still a start
// A start fits when its cost is at most this factor above the typical cost of the clip so far.
constexpr double kGoodFactor = 2.5;
// Robust scales while looking for the pose, as a factor of the final ones.
constexpr double kInitialLossWidth = 3;
// Exchanged sides must explain the frame this much better.
constexpr double kSwapPenalty = 1.5;

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
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Observation2d& point : observation.points) {
    const Eigen::Vector2d m = Undistort(evidence.camera(), point.pixel);
    const Eigen::Vector3d x = state.joints.col(point.joint);
    for (int axis = 0; axis < 2; ++axis) {
      Eigen::Vector3d row = Eigen::Vector3d::Unit(axis);
      row.z() = -m[axis];
      a += point.weight * row * row.transpose();
      b += point.weight * row * (m[axis] * x.z() - x[axis]);
    }
  }
  const Eigen::Vector3d translation = a.ldlt().solve(b);
  if (translation.allFinite() && translation.z() > 0.3) return translation;
  const Eigen::Vector3d ray = observation.camera_from_ray.col(2);
  return ray * (3.0 / std::max(0.1, ray.z()));
}

// The best solution of one frame over several starts.
class FrameSearch {
 public:
  explicit FrameSearch(const ClipEvidence& evidence)
      : evidence_(evidence), relaxed_(RelaxedPose(evidence.skeleton())) {}

  void Reset() { cost = std::numeric_limits<double>::infinity(); }

  // From afar a narrow robust loss would see nothing but outliers: plain squares lead the way.
  void FromPose(const FrameObservation& observation, SideSwap side_swap,
                const Eigen::VectorXd& start, bool near_by) {
    Eigen::VectorXd candidate = start;
    if (!near_by) Solve(observation, 0, &candidate);
    const SolveSummary summary = Solve(observation, kInitialLossWidth, &candidate);
    if (summary.termination == Termination::kFailed) return;
    const double candidate_cost =
        summary.final_cost * (side_swap == SideSwap::kNone ? 1 : kSwapPenalty);
    if (candidate_cost >= cost) return;
    cost = candidate_cost;
    pose = candidate;
    swap = side_swap;
  }

  void FromFacings(const FrameObservation& observation, SideSwap side_swap) {
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
      for (Eigen::VectorXd start : {relaxed_, ZeroPose(evidence_.skeleton())}) {
        start.segment<3>(3) = LogSO3(facing);
        start.head<3>() = FitRootTranslation(evidence_, observation, start);
        FromPose(observation, side_swap, start, /*near_by=*/false);
      }
    }
  }

  double cost = std::numeric_limits<double>::infinity();
  Eigen::VectorXd pose;
  SideSwap swap = SideSwap::kNone;

 private:
  SolveSummary Solve(const FrameObservation& observation, double loss_width,
                     Eigen::VectorXd* candidate) {
    const FrameProblem problem =
        evidence_.MakeProblem(observation, PersonDepth(*candidate), loss_width, {}, relaxed_);
    return SolveFrame(evidence_.skeleton(), problem, evidence_.options().frame_solver, candidate,
                      &scratch_);
  }

  const ClipEvidence& evidence_;
  Eigen::VectorXd relaxed_;
  FrameSolveScratch scratch_;
};

// Exchanges worth a try. When 2D and 3D contradict each other but agree after exchanging one of
// them, one is wrong; else both are or none is.
std::vector<SideSwap> PossibleSwaps(const ClipEvidence& evidence, const FrameObservation& seen,
                                    int f) {
  const FrameObservation exchanged = evidence.Observe(f, SideSwap::k2d);
  if (exchanged.use_3d && exchanged.pck < 0.5 * seen.pck) return {SideSwap::k2d, SideSwap::k3d};
  return {SideSwap::kBoth};
}

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

}  // namespace

double PersonDepth(const Eigen::VectorXd& pose) { return std::max(0.1, pose[2]); }

FrameInitialization InitializeFrames(const ClipEvidence& evidence) {
  const int num_frames = evidence.num_frames();
  FrameInitialization result;
  result.poses.setZero(evidence.skeleton().num_dofs(), num_frames);
  result.swaps.assign(num_frames, SideSwap::kNone);
  result.observed.assign(num_frames, false);

  FrameSearch search(evidence);
  int previous = -1;
  double cost_sum = 0;
  int num_solved = 0;
  for (int f = 0; f < num_frames; ++f) {
    result.observations.push_back(evidence.Observe(f));
    if (static_cast<int>(result.observations[f].points.size()) < kMinPoints) continue;
    search.Reset();
    const auto fits = [&] {
      return num_solved >= 5 && search.cost <= kGoodFactor * cost_sum / num_solved;
    };
    const FrameObservation& seen = result.observations[f];
    if (previous >= 0 && f - previous <= kMaxTrackedGap) {
      const Eigen::VectorXd start = result.poses.col(previous);
      search.FromPose(seen, SideSwap::kNone, start, /*near_by=*/true);
      if (!fits()) {
        for (const SideSwap swap : PossibleSwaps(evidence, seen, f)) {
          search.FromPose(evidence.Observe(f, swap), swap, start, /*near_by=*/true);
        }
      }
    }
    if (!fits()) search.FromFacings(result.observations[f], SideSwap::kNone);
    if (!std::isfinite(search.cost)) continue;

    result.poses.col(f) = search.pose;
    result.swaps[f] = search.swap;
    if (search.swap != SideSwap::kNone) result.observations[f] = evidence.Observe(f, search.swap);
    result.observed[f] = true;
    cost_sum += search.cost;
    ++num_solved;
    previous = f;
  }
  if (num_solved == 0) {
    throw Error(ErrorCode::kMismatch,
                "no frame has enough 2D detections of a person (4 joints with confidence above 0)");
  }
  FillGaps(result.observed, &result.poses);
  return result;
}

}  // namespace mpc
