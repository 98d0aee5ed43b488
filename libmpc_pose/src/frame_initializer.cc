#include "mpc/pose/frame_initializer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"

namespace mpc {
namespace {

constexpr int kMinPoints = 4;
// A tracked start is good when its cost is at most this factor above the clip's typical cost.
constexpr double kGoodFactor = 2.5;

std::optional<Eigen::Vector3d> BoneVector(const Skeleton& skeleton,
                                          const std::vector<EvidenceBone>& bones,
                                          const FrameObservation& observation, JointId a,
                                          JointId b) {
  for (size_t i = 0; i < observation.bone.size(); ++i) {
    const EvidenceBone& bone = bones[observation.bone[i]];
    if (skeleton.joints[bone.a].id == a && skeleton.joints[bone.b].id == b) {
      return observation.bone_vector[i];
    }
  }
  return std::nullopt;
}

// Pelvis orientation of the 3D detection: left from the hips, up towards the shoulders.
std::optional<Eigen::Matrix3d> TorsoRotation(const Skeleton& skeleton,
                                             const std::vector<EvidenceBone>& bones,
                                             const FrameObservation& observation) {
  const auto vector = [&](JointId a, JointId b) {
    return BoneVector(skeleton, bones, observation, a, b);
  };
  const auto hips = vector(JointId::kLeftHip, JointId::kRightHip);
  const auto shoulders = vector(JointId::kLeftShoulder, JointId::kRightShoulder);
  const auto left_up = vector(JointId::kPelvis, JointId::kLeftShoulder);
  const auto right_up = vector(JointId::kPelvis, JointId::kRightShoulder);
  if (!left_up || !right_up || (!hips && !shoulders)) return std::nullopt;
  Eigen::Vector3d left = Eigen::Vector3d::Zero();
  if (hips) left -= hips->normalized();
  if (shoulders) left -= shoulders->normalized();
  const Eigen::Vector3d up = (*left_up + *right_up).normalized();
  left -= left.dot(up) * up;
  if (left.norm() < 0.1) return std::nullopt;
  left.normalize();
  Eigen::Matrix3d rotation;
  rotation << left, up, left.cross(up);
  return rotation;
}

// Where the root must be for a pose of the given rotation to project onto the 2D points: the same
// linear fit as t_f, with the posed skeleton in place of the detection.
Eigen::Vector3d FitRootTranslation(const Skeleton& skeleton, const Camera& camera,
                                   const FrameObservation& observation, Eigen::VectorXd pose) {
  pose.head<3>().setZero();
  KinematicState state;
  ForwardKinematics(skeleton, pose, &state);
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Observation2d& point : observation.points) {
    const Eigen::Vector2d m = Undistort(camera, point.pixel);
    const Eigen::Vector3d x = state.joints.col(point.joint);
    for (int axis = 0; axis < 2; ++axis) {
      Eigen::Vector3d row = Eigen::Vector3d::Unit(axis);
      row.z() = -m[axis];
      a += point.weight * row * row.transpose();
      b += point.weight * row * (m[axis] * x.z() - x[axis]);
    }
  }
  Eigen::Vector3d translation = a.ldlt().solve(b);
  if (!translation.allFinite() || translation.z() < 0.3) {
    const Eigen::Vector3d ray = observation.camera_from_ray.col(2);
    translation = ray * (3.0 / std::max(0.1, ray.z()));
  }
  return translation;
}

}  // namespace

double PersonDepth(const Eigen::VectorXd& pose) { return std::max(0.1, pose[2]); }

Eigen::VectorXd BlendPoses(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double w) {
  Eigen::VectorXd blended = (1 - w) * a + w * b;
  const Eigen::Matrix3d from = ExpSO3(a.segment<3>(3));
  const Eigen::Vector3d turn = LogSO3(from.transpose() * ExpSO3(b.segment<3>(3)));
  blended.segment<3>(3) = LogSO3(from * ExpSO3(w * turn));
  return blended;
}

FrameInitialization InitializeFrames(const Skeleton& skeleton,
                                     const std::vector<EvidenceBone>& bones, const Camera& camera,
                                     const std::vector<FrameObservation>& observations,
                                     const PoseOptions& options) {
  const int num_frames = static_cast<int>(observations.size());
  PoseOptions plain = options;  // from far away a robust loss would see nothing but outliers
  plain.robust_2d = 0;
  plain.robust_3d = 0;

  FrameInitialization result;
  result.poses.setZero(skeleton.num_dofs(), num_frames);
  result.observed.assign(num_frames, false);
  result.cost.assign(num_frames, 0);
  FrameSolveScratch scratch;
  const Eigen::VectorXd relaxed = RelaxedPose(skeleton);
  int previous = -1;
  double typical_cost = 0;  // mean over the frames solved so far
  int num_solved = 0;

  for (int f = 0; f < num_frames; ++f) {
    const FrameObservation& observation = observations[f];
    if (observation.points.size() < kMinPoints) continue;

    double best_cost = std::numeric_limits<double>::infinity();
    Eigen::VectorXd best;
    const auto attempt = [&](const Eigen::VectorXd& start_pose) {
      Eigen::VectorXd pose = start_pose;
      const FrameProblem problem =
          MakeFrameProblem(skeleton, bones, camera, observation, PersonDepth(pose), {}, plain);
      const SolveSummary summary =
          SolveFrame(skeleton, problem, options.frame_solver, &pose, &scratch);
      // Costs in millimetres at the person are comparable only per squared depth.
      const double scale = options.pixels_in_mm ? 1 / PersonDepth(start_pose) : 1;
      const double cost = summary.final_cost * scale * scale;
      if (summary.termination != Termination::kFailed && cost < best_cost) {
        best_cost = cost;
        best = pose;
      }
    };
    if (previous >= 0 && f - previous <= 5) attempt(result.poses.col(previous));
    const bool tracked = num_solved >= 5 && best_cost <= kGoodFactor * typical_cost / num_solved;
    if (!tracked) {
      std::vector<Eigen::Matrix3d> rotations;
      if (observation.use_3d) {
        if (const auto torso = TorsoRotation(skeleton, bones, observation)) {
          rotations.push_back(*torso);
        }
      }
      if (rotations.empty()) {
        // Upright, facing four ways: the camera's y points down.
        const Eigen::Matrix3d upright =
            Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()).toRotationMatrix();
        for (int quarter = 0; quarter < 4; ++quarter) {
          rotations.push_back(upright * Eigen::AngleAxisd(quarter * std::numbers::pi / 2,
                                                          Eigen::Vector3d::UnitY()));
        }
      }
      for (const Eigen::Matrix3d& rotation : rotations) {
        for (const bool from_rest : {true, false}) {
          Eigen::VectorXd pose = from_rest ? relaxed : ZeroPose(skeleton);
          pose.segment<3>(3) = LogSO3(rotation);
          pose.head<3>() = FitRootTranslation(skeleton, camera, observation, pose);
          attempt(pose);
        }
      }
    }
    if (!std::isfinite(best_cost)) continue;
    result.poses.col(f) = best;
    result.observed[f] = true;
    result.cost[f] = best_cost;
    typical_cost += best_cost;
    ++num_solved;
    previous = f;
  }
  if (num_solved == 0) {
    throw Error(ErrorCode::kMismatch,
                "no frame has enough 2D detections of a person (at least 4 joints with confidence "
                "above 0)");
  }

  // Gaps: between neighbours, or the nearest frame at the ends.
  int last = -1;
  for (int f = 0; f < num_frames; ++f) {
    if (!result.observed[f]) continue;
    for (int g = last + 1; g < f; ++g) {
      result.poses.col(g) = last < 0 ? Eigen::VectorXd(result.poses.col(f))
                                     : BlendPoses(result.poses.col(last), result.poses.col(f),
                                                  static_cast<double>(g - last) / (f - last));
    }
    last = f;
  }
  for (int g = last + 1; g < num_frames; ++g) result.poses.col(g) = result.poses.col(last);
  return result;
}

}  // namespace mpc
