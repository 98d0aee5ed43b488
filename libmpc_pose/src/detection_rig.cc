#include "mpc/pose/detection_rig.h"

#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/pose/frame_solver.h"
#include "translation_fit.h"

namespace mpc {
namespace {

constexpr size_t kMinShapePoints = 4;
constexpr double kStartDistance = 3;  // m; E_3d does not see it

// Upright (the camera's y points down), facing four ways.
std::vector<Eigen::VectorXd> Starts(const Skeleton& skeleton) {
  std::vector<Eigen::VectorXd> starts;
  const Eigen::AngleAxisd upright(std::numbers::pi, Eigen::Vector3d::UnitX());
  for (int quarter = 0; quarter < 4; ++quarter) {
    const Eigen::AngleAxisd turn(quarter * std::numbers::pi / 2, Eigen::Vector3d::UnitY());
    Eigen::VectorXd start = RelaxedPose(skeleton);
    start.z() = kStartDistance;
    start.segment<3>(3) = LogSO3((upright * turn).toRotationMatrix());
    starts.push_back(start);
  }
  return starts;
}

// The pose of the detection's shape, at the place of `start`; empty without a 3D detection.
std::optional<Eigen::VectorXd> FitShape(const ClipEvidence& evidence,
                                        const FrameObservation& observation,
                                        const std::vector<Eigen::VectorXd>& starts) {
  if (observation.bone.empty()) return std::nullopt;
  FrameObservation only_3d = observation;
  only_3d.points.clear();
  only_3d.use_3d = true;
  const FrameProblem problem = evidence.MakeProblem(only_3d, kStartDistance, /*loss_width=*/0,
                                                    RelaxedPose(evidence.skeleton()));
  std::optional<Eigen::VectorXd> best;
  double lowest = std::numeric_limits<double>::infinity();
  FrameSolveScratch scratch;
  for (const Eigen::VectorXd& start : starts) {
    Eigen::VectorXd pose = start;
    const SolveSummary summary =
        SolveFrame(evidence.skeleton(), problem, evidence.options().frame_solver, &pose, &scratch);
    if (summary.final_cost < lowest) lowest = summary.final_cost, best = pose;
  }
  return best;
}

// Moves the root to where the pose projects onto the 2D detections, if there are enough.
void FitPlace(const ClipEvidence& evidence, const FrameObservation& observation,
              Eigen::VectorXd* pose) {
  if (observation.points.size() < kMinShapePoints) return;
  Eigen::VectorXd at_origin = *pose;
  at_origin.head<3>().setZero();
  KinematicState state;
  ForwardKinematics(evidence.skeleton(), at_origin, &state);
  TranslationFit fit;
  for (const Observation2d& point : observation.points) {
    fit.Add(state.joints.col(point.joint), Undistort(evidence.camera(), point.pixel), point.weight);
  }
  const Eigen::Vector3d translation = fit.Solve();
  if (translation.allFinite() && translation.z() > 0) pose->head<3>() = translation;
}

}  // namespace

Eigen::MatrixXd RigDetections(const ClipEvidence& evidence) {
  const std::vector<Eigen::VectorXd> starts = Starts(evidence.skeleton());
  const int num_frames = evidence.num_frames();
  Eigen::MatrixXd poses(starts.front().size(), num_frames);
  int first = -1;  // frame with a 3D detection
  for (int f = 0; f < num_frames; ++f) {
    const FrameObservation observation = evidence.Observe(f);
    const std::optional<Eigen::VectorXd> shape = FitShape(evidence, observation, starts);
    if (shape && first < 0) first = f;
    Eigen::VectorXd pose = shape ? *shape : Eigen::VectorXd(f > 0 ? poses.col(f - 1) : starts[0]);
    if (f > 0) pose.head<3>() = poses.col(f - 1).head<3>();
    FitPlace(evidence, observation, &pose);
    if (shape && observation.points.size() >= kMinShapePoints) {
      // Only now the ray through the hips is known, along which the 3D detection may be turned.
      const Eigen::Vector3d hips = pose.head<3>();
      const FrameObservation turned = evidence.Observe(f, SideSwap::kNone, &hips);
      pose = FitShape(evidence, turned, {pose}).value_or(pose);
      FitPlace(evidence, turned, &pose);
    }
    poses.col(f) = pose;
  }
  if (first < 0) {
    throw Error(ErrorCode::kMismatch, "there is no 3D detection in any frame");
  }
  for (int f = 0; f < first; ++f) poses.col(f) = poses.col(first);
  return poses;
}

}  // namespace mpc
