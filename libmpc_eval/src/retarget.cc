#include "mpc/eval/retarget.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "floor.h"
#include "motion_source.h"
#include "mpc/core/error.h"
#include "mpc/core/joints.h"
#include "mpc/core/rigid.h"
#include "mpc/core/units.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

using enum JointId;

// The 16 joints in the skeleton; throws when one is missing.
JointMap SkeletonJoints(const Skeleton& skeleton) {
  JointMap joints;
  for (int j = 0; j < kNumPaperJoints; ++j) {
    const auto id = static_cast<JointId>(j);
    joints[id] = skeleton.FindJointIndex(id);
    if (joints[id] < 0) {
      throw Error(ErrorCode::kInvalidArgument,
                  fmt::format("the skeleton has no joint {}", JointName(id)));
    }
  }
  return joints;
}

// min sum |limb - target|^2 + rest |angles|^2 + smooth |angles - previous|^2 within the bounds;
// projected Levenberg-Marquardt over root rotation (left increments) and angles.
class DirectionFit {
 public:
  explicit DirectionFit(const Skeleton& skeleton)
      : skeleton_(skeleton),
        joints_(SkeletonJoints(skeleton)),
        num_hinges_(static_cast<int>(skeleton.hinges.size())),
        lower_(skeleton.LowerBounds().tail(num_hinges_)),
        upper_(skeleton.UpperBounds().tail(num_hinges_)) {}

  struct Solution {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::VectorXd angles;
    double cost = std::numeric_limits<double>::infinity();
  };

  Solution Solve(const LimbDirections& target, const Solution& start,
                 const Eigen::VectorXd* previous) {
    constexpr int kMaxIterations = 60;
    Solution best = start;
    best.angles = best.angles.cwiseMax(lower_).cwiseMin(upper_);
    best.cost = Linearise(target, best, previous);
    double damping = 1e-4;
    for (int iteration = 0; iteration < kMaxIterations && damping < 1e6; ++iteration) {
      const Eigen::VectorXd step = Step(best, damping);
      Solution candidate;
      candidate.rotation = ExpSO3(step.head<3>()) * best.rotation;
      candidate.angles = (best.angles + step.tail(num_hinges_)).cwiseMax(lower_).cwiseMin(upper_);
      candidate.cost = Linearise(target, candidate, previous);
      if (candidate.cost < best.cost) {
        const bool converged = best.cost - candidate.cost < 1e-9 * best.cost + 1e-14;
        best = candidate;
        damping = std::max(1e-7, 0.2 * damping);
        if (converged) break;
      } else {
        damping *= 10;
        Linearise(target, best, previous);
      }
    }
    return best;
  }

  // Angle between each limb and its target, rad; zero for limbs without a target.
  Eigen::VectorXd AngleErrors(const LimbDirections& target, const Solution& solution) {
    Place(solution);
    Eigen::VectorXd errors = Eigen::VectorXd::Zero(kNumLimbs);
    for (int l = 0; l < kNumLimbs; ++l) {
      if (target.col(l).isZero()) continue;
      const double chord = (LimbVector(l).normalized() - target.col(l)).norm();
      errors[l] = 2 * std::asin(std::min(1.0, 0.5 * chord));
    }
    return errors;
  }

 private:
  void Place(const Solution& solution) {
    pose_.setZero(skeleton_.num_dofs());
    pose_.tail(num_hinges_) = solution.angles;
    ForwardKinematics(skeleton_, pose_, solution.rotation, &state_);
  }

  Eigen::Vector3d LimbVector(int limb) const {
    const auto point = [&](const std::array<JointId, 2>& ends) -> Eigen::Vector3d {
      return 0.5 * (state_.joints.col(joints_[ends[0]]) + state_.joints.col(joints_[ends[1]]));
    };
    return point(kLimbs[limb].to) - point(kLimbs[limb].from);
  }

  // Normal equations at a solution; returns its cost.
  double Linearise(const LimbDirections& target, const Solution& solution,
                   const Eigen::VectorXd* previous) {
    constexpr double kRestWeight = 0.02 * 0.02;
    constexpr double kSmoothWeight = 0.05 * 0.05;
    Place(solution);
    JointJacobian(skeleton_, state_, &joint_jacobian_);
    const int num_free = 3 + num_hinges_;
    normal_.setZero(num_free, num_free);
    gradient_.setZero(num_free);
    double cost = 0;
    for (int l = 0; l < kNumLimbs; ++l) {
      if (target.col(l).isZero()) continue;
      const Eigen::Vector3d vector = LimbVector(l);
      const double length = vector.norm();
      const Eigen::Vector3d direction = vector / length;
      const auto rows = [&](const std::array<JointId, 2>& ends) -> Eigen::MatrixXd {
        return 0.5 * (joint_jacobian_.middleRows<3>(3 * joints_[ends[0]]) +
                      joint_jacobian_.middleRows<3>(3 * joints_[ends[1]]));
      };
      const Eigen::Matrix3d tangent =
          (Eigen::Matrix3d::Identity() - direction * direction.transpose()) / length;
      const Eigen::MatrixXd jacobian =
          tangent * (rows(kLimbs[l].to) - rows(kLimbs[l].from)).rightCols(num_free);
      const Eigen::Vector3d residual = direction - target.col(l);
      normal_.noalias() += jacobian.transpose() * jacobian;
      gradient_.noalias() += jacobian.transpose() * residual;
      cost += residual.squaredNorm();
    }
    const auto pull = [&](const Eigen::VectorXd& offset, double weight) {
      normal_.diagonal().tail(num_hinges_).array() += weight;
      gradient_.tail(num_hinges_) += weight * offset;
      cost += weight * offset.squaredNorm();
    };
    pull(solution.angles, kRestWeight);
    if (previous != nullptr) pull(solution.angles - *previous, kSmoothWeight);
    return cost;
  }

  // Damped step; angles that would leave their bounds stand still.
  Eigen::VectorXd Step(const Solution& at, double damping) const {
    Eigen::MatrixXd system = normal_;
    Eigen::VectorXd right = -gradient_;
    system.diagonal().array() += damping;
    for (int h = 0; h < num_hinges_; ++h) {
      const bool stuck = (at.angles[h] <= lower_[h] && right[3 + h] < 0) ||
                         (at.angles[h] >= upper_[h] && right[3 + h] > 0);
      if (!stuck) continue;
      system.row(3 + h).setZero();
      system.col(3 + h).setZero();
      system(3 + h, 3 + h) = 1;
      right[3 + h] = 0;
    }
    return system.ldlt().solve(right);
  }

  const Skeleton& skeleton_;
  JointMap joints_;
  int num_hinges_;
  Eigen::VectorXd lower_;
  Eigen::VectorXd upper_;
  KinematicState state_;
  Eigen::VectorXd pose_;
  Eigen::MatrixXd joint_jacobian_;
  Eigen::MatrixXd normal_;
  Eigen::VectorXd gradient_;
};

// Root rotation from the hip line and the trunk.
Eigen::Matrix3d TrunkRotation(const LimbDirections& directions) {
  const Eigen::Vector3d left = directions.col(0);
  const Eigen::Vector3d forward = left.cross(Eigen::Vector3d(directions.col(1)));
  if (forward.norm() < 1e-6) return Eigen::Matrix3d::Identity();
  Eigen::Matrix3d rotation;
  rotation << left, forward.normalized().cross(left), forward.normalized();
  return rotation;
}

// Angles to start from: rest, arms hanging, crouching, arms raised.
std::vector<Eigen::VectorXd> StartAngles(const Skeleton& skeleton) {
  struct Setting {
    std::string_view hinge;  // end of the name, so that both sides are alike
    double angle_deg;
  };
  const std::vector<std::vector<Setting>> starts = {
      {},
      {{"shoulder_abduction", -70}, {"elbow_flexion", 20}, {"knee_flexion", 10}},
      {{"shoulder_abduction", -60},
       {"shoulder_flexion", 60},
       {"elbow_flexion", 60},
       {"hip_flexion", 80},
       {"knee_flexion", 90},
       {"spine_flexion", 30}},
      {{"shoulder_abduction", 60}, {"elbow_flexion", 30}, {"knee_flexion", 20}},
  };
  std::vector<Eigen::VectorXd> angles;
  for (const std::vector<Setting>& start : starts) {
    Eigen::VectorXd pose = Eigen::VectorXd::Zero(static_cast<int>(skeleton.hinges.size()));
    for (const Setting& setting : start) {
      for (size_t h = 0; h < skeleton.hinges.size(); ++h) {
        if (skeleton.hinges[h].name.ends_with(setting.hinge)) {
          pose[h] = setting.angle_deg * kDegree;
        }
      }
    }
    angles.push_back(pose);
  }
  return angles;
}

// Root rotations and angles of all frames, root translation zero.
Eigen::MatrixXd FitDirections(const Skeleton& skeleton, const std::vector<LimbDirections>& targets,
                              RetargetSummary* summary) {
  // A limb this far off makes a frame try the starts again: the previous frame may have led into a
  // local minimum. Continuity is given up only for a much better fit.
  constexpr double kSuspicious = 15 * kDegree;
  constexpr double kMuchBetter = 0.5;
  DirectionFit fit(skeleton);
  const std::vector<Eigen::VectorXd> starts = StartAngles(skeleton);
  Eigen::MatrixXd poses(skeleton.num_dofs(), static_cast<Eigen::Index>(targets.size()));
  DirectionFit::Solution solution;
  for (size_t f = 0; f < targets.size(); ++f) {
    const Eigen::VectorXd before = solution.angles;
    const Eigen::VectorXd* previous = f > 0 ? &before : nullptr;
    Eigen::VectorXd errors;
    if (f > 0) {
      solution = fit.Solve(targets[f], solution, previous);
      errors = fit.AngleErrors(targets[f], solution);
    }
    if (f == 0 || errors.maxCoeff() > kSuspicious) {
      const double to_beat = solution.cost * (f > 0 ? kMuchBetter : 1);
      for (const Eigen::VectorXd& angles : starts) {
        const DirectionFit::Solution candidate =
            fit.Solve(targets[f], {TrunkRotation(targets[f]), angles}, previous);
        if (candidate.cost < std::min(to_beat, solution.cost)) solution = candidate;
      }
      errors = fit.AngleErrors(targets[f], solution);
    }
    const auto num_known =
        static_cast<double>((targets[f].colwise().squaredNorm().array() > 0).count());
    const double frame_error = errors.sum() / std::max(1.0, num_known);
    summary->mean_direction_error_rad += frame_error / static_cast<double>(targets.size());
    summary->max_direction_error_rad = std::max(summary->max_direction_error_rad, frame_error);
    poses.col(static_cast<Eigen::Index>(f)) << Eigen::Vector3d::Zero(), LogSO3(solution.rotation),
        solution.angles;
  }
  return poses;
}

// Mean length of the legs from hip to ankle.
double LegLength(const JointMap& joints, const Eigen::Matrix3Xd& positions) {
  const auto distance = [&](JointId a, JointId b) {
    return (positions.col(joints[a]) - positions.col(joints[b])).norm();
  };
  return 0.5 * (distance(kLeftHip, kLeftKnee) + distance(kLeftKnee, kLeftAnkle) +
                distance(kRightHip, kRightKnee) + distance(kRightKnee, kRightAnkle));
}

// Height above the floor for something `height` above it in the source: heights that are small
// against `contact` count as contact, large ones lose about `contact`.
double Clearance(double height, double contact) { return height * height / (height + contact); }

// Triangular moving average of half-width `reach` (frames).
Eigen::VectorXd Smoothed(const Eigen::VectorXd& values, double reach) {
  const auto half = static_cast<Eigen::Index>(std::min(reach, 1e3));
  Eigen::VectorXd smoothed(values.size());
  for (Eigen::Index f = 0; f < values.size(); ++f) {
    double sum = 0;
    double weights = 0;
    for (Eigen::Index d = -half; d <= half; ++d) {
      if (f + d < 0 || f + d >= values.size()) continue;
      const double weight = static_cast<double>(half + 1 - std::abs(d));
      sum += weight * values[f + d];
      weights += weight;
    }
    smoothed[f] = sum / weights;
  }
  return smoothed;
}

// Sets the root translations: the middle of the hips follows the source's in the plane; in height
// the lowest joint follows the source's lowest.
void PlaceRoot(const Skeleton& skeleton, const SourceMotion& source, const JointMap& map,
               double scale, double leg_length, Eigen::MatrixXd* poses) {
  const JointMap ours = SkeletonJoints(skeleton);
  // Joints with the one whose height in the source they are measured from. Feet enter with our own
  // shape, because which points of its feet a source has differs.
  std::vector<std::pair<int, JointId>> height_points;
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    switch (const JointId id = skeleton.joints[j].id) {
      case kLeftToe:
      case kLeftHeel:
      case kLeftSmallToe:
        height_points.emplace_back(j, kLeftAnkle);
        break;
      case kRightToe:
      case kRightHeel:
      case kRightSmallToe:
        height_points.emplace_back(j, kRightAnkle);
        break;
      default:
        if (static_cast<int>(id) < kNumPaperJoints && map[id] >= 0)
          height_points.emplace_back(j, id);
    }
  }
  const Eigen::MatrixXd trajectories = JointTrajectories(skeleton, *poses);
  const double temperature = 0.003 * leg_length;
  Eigen::VectorXd source_low(poses->cols());
  Eigen::VectorXd our_low(poses->cols());
  Eigen::VectorXd our_heights(static_cast<Eigen::Index>(height_points.size()));
  Eigen::VectorXd source_heights(our_heights.size());
  for (Eigen::Index f = 0; f < poses->cols(); ++f) {
    const Eigen::Matrix3Xd& theirs = source.joint_positions[f];
    const Eigen::Matrix3Xd joints = trajectories.col(f).reshaped(3, skeleton.num_joints());
    const Eigen::Vector3d their_hips =
        0.5 * (theirs.col(map[kLeftHip]) + theirs.col(map[kRightHip]));
    const Eigen::Vector3d our_hips =
        0.5 * (joints.col(ours[kLeftHip]) + joints.col(ours[kRightHip]));
    poses->col(f).head<3>() = scale * their_hips - our_hips;
    for (Eigen::Index i = 0; i < our_heights.size(); ++i) {
      const auto& [joint, reference] = height_points[i];
      our_heights[i] = joints(1, joint);
      source_heights[i] =
          scale * theirs(1, map[reference]) + joints(1, joint) - joints(1, ours[reference]);
    }
    source_low[f] = SoftMin(source_heights, temperature);
    our_low[f] = SoftMin(our_heights, temperature);
  }
  // The source's floor: the height of its lowest joint that only one frame in twenty goes below.
  Eigen::VectorXd sorted = source_low;
  std::sort(sorted.begin(), sorted.end());
  Eigen::VectorXd lift(poses->cols());
  const double source_floor = sorted[(poses->cols() - 1) / 20];
  for (Eigen::Index f = 0; f < poses->cols(); ++f) {
    const double height = std::max(0.0, source_low[f] - source_floor);
    lift[f] = Clearance(height, 0.06 * leg_length) - our_low[f] - (*poses)(1, f);
  }
  // The lift follows the floor, not every twitch of a foot.
  poses->row(1) += Smoothed(lift, 0.1 * source.fps).transpose();
}

}  // namespace

void SourceMotion::Validate() const {
  const auto num_joints = static_cast<int>(names.size());
  std::string faults;
  const auto fault = [&](const std::string& text) {
    faults += (faults.empty() ? "" : "; ") + text;
  };
  if (joint_positions.empty()) fault("no frames");
  if (!(fps > 0) || !std::isfinite(fps)) fault(fmt::format("{} frames per second", fps));
  if (parents.size() != names.size()) {
    fault(fmt::format("{} parents for {} joints", parents.size(), names.size()));
  }
  for (size_t j = 0; j < parents.size(); ++j) {
    if (parents[j] < -1 || parents[j] >= static_cast<int>(j)) {
      fault(fmt::format("joint {} has parent {}", j, parents[j]));
      break;
    }
  }
  for (size_t f = 0; f < joint_positions.size(); ++f) {
    if (joint_positions[f].cols() != num_joints || !joint_positions[f].allFinite()) {
      fault(fmt::format("frame {} has not {} finite positions", f, num_joints));
      break;
    }
  }
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "invalid motion: " + faults);
}

Eigen::MatrixXd Retarget(const Skeleton& skeleton, const SourceMotion& source,
                         RetargetSummary* summary) {
  skeleton.Validate();
  source.Validate();
  const JointMap map = MapSourceJoints(source);
  const JointMap ours = SkeletonJoints(skeleton);

  KinematicState rest;
  ForwardKinematics(skeleton, ZeroPose(skeleton), &rest);
  const double our_leg = LegLength(ours, rest.joints);
  const double source_leg = LegLength(map, source.joint_positions.front());
  if (!(source_leg > 0)) {
    throw Error(ErrorCode::kInvalidArgument, "the motion's legs have no length");
  }
  const Eigen::Vector3d foot = rest.joints.col(ours[kLeftToe]) - rest.joints.col(ours[kLeftAnkle]);

  RetargetSummary result;
  result.scale = our_leg / source_leg;
  Eigen::MatrixXd poses =
      FitDirections(skeleton, SourceDirections(source, map, PitchDown(foot.normalized())), &result);
  PlaceRoot(skeleton, source, map, result.scale, our_leg, &poses);
  if (summary != nullptr) *summary = result;
  return poses;
}

}  // namespace mpc
