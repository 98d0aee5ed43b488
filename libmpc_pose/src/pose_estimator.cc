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
// Exchanged sides are reported when the mean distance is above the usual and they explain the frame
// this much better.
constexpr double kTypicalMm = 50;
constexpr double kSwapFactor = 1.5;
// Share of w_d inside the subspace never quite reaches 1: coefficients stay variables of their own.
constexpr double kMaxBandPenalty = 0.999;
constexpr int kNumRounds = 3;
constexpr double kRoughTolerance = 10;  // of all rounds but the last, times the options'

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
  problem->band_penalty.setZero(num_dofs, size);
  if (!options.soft_band) return;
  for (int k = 0; k < size; ++k) {
    problem->band_penalty.col(k).setConstant(
        std::min(kMaxBandPenalty, std::pow(static_cast<double>(k) / size, 8)));
  }
}

BatchProblem MakeBatch(const ClipEvidence& evidence, const FrameInitialization& initialization,
                       const Window& window, const Eigen::MatrixXd& poses) {
  BatchProblem problem;
  problem.skeleton = evidence.skeleton();
  const Eigen::VectorXd relaxed = RelaxedPose(evidence.skeleton());
  for (int f = window.begin; f < window.end; ++f) {
    const Eigen::VectorXd pose = initialization.poses.col(f);
    // What nobody saw is kept at its interpolation, not pulled to rest.
    const Eigen::VectorXd& rest = initialization.observed[f] ? relaxed : pose;
    KinematicState state;
    ForwardKinematics(evidence.skeleton(), poses.col(f), &state);
    problem.frames.push_back(evidence.MakeProblem(initialization.observations[f], PersonDepth(pose),
                                                  /*loss_width=*/1, rest, &state.joints));
  }
  SetSmoothness(evidence.options(), evidence.fps(), window.size(), &problem);
  return problem;
}

// The band's penalties after the spectrum of an earlier solution of the clip.
void AdaptBand(const FrameInitialization& initialization, const Window& window,
               const Eigen::MatrixXd& poses, BatchProblem* problem) {
  const Eigen::MatrixXd spectrum =
      SubspaceCoefficients(*problem, poses.middleCols(window.begin, window.size()));
  // What was not observed shows no motion.
  const auto first = initialization.observed.begin() + window.begin;
  const double observed_share =
      static_cast<double>(std::count(first, first + window.size(), true)) / window.size();
  problem->band_penalty =
      observed_share * AdaptedShares(spectrum, problem->smoothness, kNoiseCost, kMaxBandPenalty);
}

// Detections of one frame beside the projected joints, sides as detected or exchanged.
struct Comparison {
  std::vector<JointReport> joints;
  double residual_px = 0;  // mean
  int num_seen = 0;
};

Comparison Compare(const ClipEvidence& evidence, const Detections2d& detections, int f,
                   const Eigen::Matrix3Xd& joints, double px_per_mm, bool exchanged) {
  const Skeleton& skeleton = evidence.skeleton();
  const Detections2d::Frame& frame = detections.frames[f];
  Comparison comparison;
  comparison.joints.resize(skeleton.num_joints());
  for (size_t i = 0; i < detections.joints.size(); ++i) {
    const JointId seen = detections.joints[i];
    const int index = skeleton.FindJointIndex(exchanged ? MirrorJoint(seen) : seen);
    Eigen::Vector2d pixel;
    if (index < 0 || frame.confidence[i] <= 0 ||
        !Project(evidence.camera(), joints.col(index), &pixel)) {
      continue;
    }
    JointReport& joint = comparison.joints[index];
    joint.residual_px = (pixel - frame.pixels.col(i)).norm();
    const double relative = joint.residual_px / (kRejectedMm * px_per_mm);
    joint.confidence = std::min(1.0, frame.confidence[i]) / (1 + relative * relative);
    joint.state = relative > 1 ? TrackState::kRejected : TrackState::kTracked;
    comparison.residual_px += joint.residual_px;
    ++comparison.num_seen;
  }
  comparison.residual_px /= std::max(1, comparison.num_seen);
  return comparison;
}

FrameReport ReportFrame(const ClipEvidence& evidence, const FrameInitialization& initialization,
                        const Detections2d& detections, const Eigen::VectorXd& pose, int f) {
  const Skeleton& skeleton = evidence.skeleton();
  KinematicState state;
  ForwardKinematics(skeleton, pose, &state);
  const double px_per_mm =
      (evidence.camera().fx + evidence.camera().fy) / 2 / (1000 * PersonDepth(pose));
  const auto compare = [&](bool exchanged) {
    return Compare(evidence, detections, f, state.joints, px_per_mm, exchanged);
  };
  Comparison seen = compare(false);
  FrameReport report;
  report.used_3d = initialization.observations[f].use_3d;
  report.swapped_sides = initialization.swaps[f] != SideSwap::kNone;
  const Comparison exchanged = compare(true);
  if (seen.residual_px > kTypicalMm * px_per_mm &&
      exchanged.residual_px * kSwapFactor < seen.residual_px) {
    seen = exchanged;
    report.swapped_sides = true;
  }
  report.joints = std::move(seen.joints);
  report.residual_px = seen.residual_px;
  int num_tracked = 0;
  for (int j = 0; j < std::min(kNumPaperJoints, skeleton.num_joints()); ++j) {
    report.confidence += report.joints[j].confidence / kNumPaperJoints;
    num_tracked += report.joints[j].state == TrackState::kTracked ? 1 : 0;
  }
  if (initialization.observed[f]) {
    report.state = 2 * num_tracked >= std::min(seen.num_seen, kNumPaperJoints)
                       ? TrackState::kTracked
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
  ClipEvidence evidence(skeleton, camera, detections2d, detections3d, fps, options);
  const int num_passes = options.fit_proportions ? 2 : 1;
  const auto initialize = [&](int pass) {
    ProgressCallback of_all_passes;
    if (progress) {
      of_all_passes = [&progress, pass, num_passes](const Progress& step) {
        return progress(
            {step.stage, pass * step.num_steps + step.step, num_passes * step.num_steps});
      };
    }
    return InitializeFrames(evidence, of_all_passes);
  };
  FrameInitialization initialization = initialize(0);
  track.seconds_initialization = initialization_watch.Seconds();

  Stopwatch calibration_watch;
  if (options.fit_proportions && !initialization.cancelled) {
    const CalibrationResult calibration = CalibrateProportions(evidence, initialization, progress);
    track.proportions = calibration.proportions;
    track.uncertainty = calibration.uncertainty;
    track.cancelled = calibration.cancelled;
    evidence = evidence.ForSkeleton(ScaledSkeleton(skeleton, track.proportions));
    if (!track.cancelled) initialization = initialize(1);
  }
  track.cancelled = track.cancelled || initialization.cancelled;
  track.seconds_calibration = calibration_watch.Seconds();

  Stopwatch batch_watch;
  const std::vector<Window> windows =
      MakeWindows(evidence.num_frames(), options.window_frames, options.overlap_frames);
  track.num_windows = static_cast<int>(windows.size());
  track.poses = initialization.poses;
  // Later rounds start from the one before, with the limbs chosen over the clip and each dof's
  // smoothness after its own spectrum.
  const int num_rounds = options.test_depth_flips || options.adaptive_band ? kNumRounds : 1;
  const bool measures_error_2d = options.error_2d_mm == 0 && num_rounds > 1;
  for (int round = 0; round < num_rounds && !track.cancelled; ++round) {
    const Eigen::MatrixXd before = track.poses;
    if (measures_error_2d && round == 0) evidence.TrustError2d();
    if (measures_error_2d && round == 1) {
      evidence.MeasureError2d(initialization.observations, track.poses);
    }
    if (round > 0 && options.test_depth_flips) ChooseLimbs(evidence, initialization, &track.poses);
    BatchSolveOptions solver = options.batch_solver;
    if (round + 1 < num_rounds) solver.relative_tolerance *= kRoughTolerance;
    std::vector<Eigen::MatrixXd> solved(windows.size());
    // Groups of a few windows keep the threads busy and let the callback stop between them.
    const int group = 4 * ResolveNumThreads(options.num_threads);
    for (int first = 0; first < track.num_windows && !track.cancelled; first += group) {
      const int count = std::min(group, track.num_windows - first);
      ParallelFor(count, options.num_threads, [&](int i) {
        const Window& window = windows[first + i];
        BatchProblem problem = MakeBatch(evidence, initialization, window, track.poses);
        if (round > 0 && options.adaptive_band) AdaptBand(initialization, window, before, &problem);
        solved[first + i] = track.poses.middleCols(window.begin, window.size());
        SolveBatch(problem, solver, &solved[first + i]);
      });
      if (progress) {
        const int done = round * track.num_windows + first + count;
        track.cancelled = !progress({"pose", done, num_rounds * track.num_windows});
      }
    }
    for (size_t w = 0; w < windows.size(); ++w) {  // windows that were not reached keep their start
      if (solved[w].size() > 0) continue;
      solved[w] = track.poses.middleCols(windows[w].begin, windows[w].size());
    }
    track.poses = BlendWindows(windows, solved, evidence.num_frames());
  }
  track.seconds_batch = batch_watch.Seconds();

  for (int f = 0; f < evidence.num_frames(); ++f) {
    track.frames.push_back(
        ReportFrame(evidence, initialization, detections2d, track.poses.col(f), f));
  }
  return track;
}

}  // namespace mpc
