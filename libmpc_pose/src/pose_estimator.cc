#include "mpc/pose/pose_estimator.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/pose/limb_search.h"
#include "mpc/pose/trajectory_basis.h"
#include "mpc/pose/windows.h"

namespace mpc {
namespace {

// A joint whose detection is farther away than this was not believed by the robust loss.
constexpr double kRejectedMm = 150;
// Share of w_d inside the subspace never quite reaches 1: coefficients stay variables of their own.
constexpr double kMaxBandPenalty = 0.999;

class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

void CheckInputs(const Skeleton& skeleton, const Camera& camera, const Detections2d& detections2d,
                 const Detections3d* detections3d, double fps, const PoseOptions& options) {
  options.Validate();
  skeleton.Validate();
  camera.Validate();
  detections2d.Validate();
  if (!(fps > 0 && fps < 1e5)) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("the frame rate is {}, not > 0", fps));
  }
  if (detections2d.frames.empty()) {
    throw Error(ErrorCode::kMismatch, "the 2D detections have no frames");
  }
  if (detections3d == nullptr) return;
  detections3d->Validate();
  if (detections3d->frames.size() != detections2d.frames.size()) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("the 2D detections have {} frames, the 3D detections {}",
                            detections2d.frames.size(), detections3d->frames.size()));
  }
}

// E_d of a window: basis, weights per dof and inside the band.
void SetSmoothness(const PoseOptions& options, double fps, int num_frames, BatchProblem* problem) {
  const int num_dofs = problem->skeleton.num_dofs();
  const int size = options.basis_size > 0 ? std::min(options.basis_size, num_frames)
                                          : BasisSize(num_frames, fps, options.cutoff_hz);
  problem->basis = DctBasis(size, num_frames);
  const auto weight = [&](double lambda) { return options.weight_smooth * lambda * lambda; };
  problem->smoothness.resize(num_dofs);
  problem->smoothness.head<3>().setConstant(weight(1000 * options.lambda_translation));
  problem->smoothness.segment<3>(3).setConstant(weight(options.lambda_rotation));
  problem->smoothness.tail(num_dofs - 6).setConstant(weight(options.lambda_angles));
  problem->band_penalty.setZero(size);
  if (!options.soft_band) return;
  for (int k = 0; k < size; ++k) {
    problem->band_penalty[k] =
        std::min(kMaxBandPenalty, std::pow(static_cast<double>(k) / size, 8));
  }
}

BatchProblem MakeBatch(const ClipEvidence& evidence, const FrameInitialization& initialization,
                       const Window& window, double fps) {
  BatchProblem problem;
  problem.skeleton = evidence.skeleton();
  const Eigen::VectorXd relaxed = RelaxedPose(evidence.skeleton());
  for (int f = window.begin; f < window.end; ++f) {
    const Eigen::VectorXd pose = initialization.poses.col(f);
    // What nobody saw is kept at its interpolation, not pulled to rest.
    const Eigen::VectorXd& rest = initialization.observed[f] ? relaxed : pose;
    problem.frames.push_back(evidence.MakeProblem(initialization.observations[f], PersonDepth(pose),
                                                  /*loss_width=*/1, rest));
  }
  SetSmoothness(evidence.options(), fps, window.size(), &problem);
  return problem;
}

FrameReport ReportFrame(const ClipEvidence& evidence, const FrameInitialization& initialization,
                        const Eigen::VectorXd& pose, int f) {
  FrameReport report;
  const Skeleton& skeleton = evidence.skeleton();
  report.joints.resize(skeleton.num_joints());
  const FrameObservation& observation = initialization.observations[f];
  report.used_3d = observation.use_3d;
  report.swapped_sides = initialization.swaps[f] != SideSwap::kNone;

  KinematicState state;
  ForwardKinematics(skeleton, pose, &state);
  const double px_per_mm =
      (evidence.camera().fx + evidence.camera().fy) / 2 / (1000 * PersonDepth(pose));
  int num_seen = 0;
  for (const Observation2d& point : observation.points) {
    JointReport& joint = report.joints[point.joint];
    Eigen::Vector2d pixel;
    if (!Project(evidence.camera(), state.joints.col(point.joint), &pixel)) continue;
    joint.residual_px = (pixel - point.pixel).norm();
    const double relative = joint.residual_px / (kRejectedMm * px_per_mm);
    joint.confidence = std::min(1.0, point.confidence) / (1 + relative * relative);
    joint.state = relative > 1 ? TrackState::kRejected : TrackState::kTracked;
    report.residual_px += joint.residual_px;
    ++num_seen;
  }
  if (num_seen > 0) report.residual_px /= num_seen;
  int num_tracked = 0;
  for (int j = 0; j < std::min(kNumPaperJoints, skeleton.num_joints()); ++j) {
    report.confidence += report.joints[j].confidence / kNumPaperJoints;
    num_tracked += report.joints[j].state == TrackState::kTracked ? 1 : 0;
  }
  if (initialization.observed[f]) {
    report.state = 2 * num_tracked >= std::min(num_seen, kNumPaperJoints) ? TrackState::kTracked
                                                                          : TrackState::kRejected;
  }
  return report;
}

}  // namespace

const char* TrackStateName(TrackState state) {
  switch (state) {
    case TrackState::kTracked:
      return "tracked";
    case TrackState::kInterpolated:
      return "interpolated";
    case TrackState::kRejected:
      return "rejected";
  }
  return "";
}

PoseTrack EstimatePoses(const Skeleton& skeleton, const Camera& camera,
                        const Detections2d& detections2d, const Detections3d* detections3d,
                        double fps, const PoseOptions& options, const ProgressCallback& progress) {
  CheckInputs(skeleton, camera, detections2d, detections3d, fps, options);
  PoseTrack track;

  Stopwatch initialization_watch;
  ClipEvidence evidence(skeleton, camera, detections2d, detections3d, options);
  FrameInitialization initialization = InitializeFrames(evidence, fps);
  track.seconds_initialization = initialization_watch.Seconds();

  Stopwatch calibration_watch;
  if (options.fit_proportions) {
    const CalibrationResult calibration =
        CalibrateProportions(evidence, detections2d, detections3d, initialization);
    track.proportions = calibration.proportions;
    track.uncertainty = calibration.uncertainty;
  }
  const ClipEvidence fitted(ScaledSkeleton(skeleton, track.proportions), camera, detections2d,
                            detections3d, options);
  if (options.fit_proportions) initialization = InitializeFrames(fitted, fps);
  track.seconds_calibration = calibration_watch.Seconds();

  Stopwatch batch_watch;
  const std::vector<Window> windows =
      MakeWindows(fitted.num_frames(), options.window_frames, options.overlap_frames);
  track.num_windows = static_cast<int>(windows.size());
  track.poses = initialization.poses;
  const auto solve_windows = [&](int first_step, int num_steps) {
    std::vector<Eigen::MatrixXd> solved(windows.size());
    for (size_t w = 0; w < windows.size(); ++w) {
      solved[w] = track.poses.middleCols(windows[w].begin, windows[w].size());
    }
    // Rounds of a few windows keep the threads busy and let the callback stop between them.
    const int round = 4 * ResolveNumThreads(options.num_threads);
    for (int first = 0; first < track.num_windows && !track.cancelled; first += round) {
      const int count = std::min(round, track.num_windows - first);
      ParallelFor(count, options.num_threads, [&](int i) {
        const int w = first + i;
        SolveBatch(MakeBatch(fitted, initialization, windows[w], fps), options.batch_solver,
                   &solved[w]);
      });
      if (progress) track.cancelled = !progress({"pose", first_step + first + count, num_steps});
    }
    track.poses = BlendWindows(windows, solved, fitted.num_frames());
  };
  if (options.test_depth_flips) {
    solve_windows(0, 2 * track.num_windows);
    if (!track.cancelled) ChooseLimbs(fitted, initialization, fps, &track.poses);
    solve_windows(track.num_windows, 2 * track.num_windows);
  } else {
    solve_windows(0, track.num_windows);
  }
  track.seconds_batch = batch_watch.Seconds();

  for (int f = 0; f < fitted.num_frames(); ++f) {
    track.frames.push_back(ReportFrame(fitted, initialization, track.poses.col(f), f));
  }
  return track;
}

}  // namespace mpc
