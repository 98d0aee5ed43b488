#include "mpc/pose/pose_estimator.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/pose/limb_search.h"
#include "mpc/pose/standing_feet.h"
#include "mpc/pose/windows.h"
#include "window_problem.h"

namespace mpc {
namespace {

// A joint whose detection is farther away than this was not believed by the robust loss.
constexpr double kRejectedMm = 150;
// Exchanged sides are reported when the mean distance is above the usual and they explain the frame
// this much better.
constexpr double kTypicalMm = 50;
constexpr double kSwapFactor = 1.5;
constexpr int kNumRounds = 3;
constexpr double kMaxAdaptations = 3;   // of the smoothness, in the last round
constexpr double kRoughTolerance = 30;  // of all solutions but the last, times the options'

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
                        double fps, const PoseOptions& options,
                        std::span<const CameraFromWorld> camera_motion,
                        const ProgressCallback& progress) {
  CheckInputs(skeleton, camera, detections2d, detections3d, fps, options);
  PoseTrack track;

  Stopwatch initialization_watch;
  ClipEvidence evidence(skeleton, camera, detections2d, detections3d, fps, options, camera_motion);
  FrameInitialization initialization = InitializeFrames(evidence, progress);
  track.seconds_initialization = initialization_watch.Seconds();
  track.cancelled = initialization.cancelled;

  Stopwatch batch_watch;
  const int num_threads = ResolveNumThreads(options.num_threads);
  const std::vector<Window> windows =
      MakeWindows(evidence.num_frames(), options.window_frames, options.overlap_frames);
  track.num_windows = static_cast<int>(windows.size());
  track.poses = initialization.poses;
  // Later rounds start from the one before, with the proportions it shows, the limbs chosen over the
  // clip, the feet that stand and each dof's smoothness after its own spectrum.
  const int num_rounds = options.fit_proportions || options.test_depth_flips ||
                                 options.hold_standing_feet || options.adaptive_band
                             ? kNumRounds
                             : 1;
  ProportionsCalibration calibration(skeleton);
  const bool measures_error_2d = options.error_2d_mm == 0 && num_rounds > 1;
  for (int round = 0; round < num_rounds && !track.cancelled; ++round) {
    const Eigen::MatrixXd before = round > 0 ? track.poses : Eigen::MatrixXd();
    if (measures_error_2d && round == 0) evidence.TrustError2d();
    if (measures_error_2d && round == 1) {
      evidence.MeasureError2d(initialization.observations, track.poses);
    }
    if (round > 0 && options.fit_proportions) {
      // Where a foot stood was measured with the proportions before.
      ForgetStandingFeet(&initialization.observations);
      const Stopwatch watch;
      calibration.Step(windows, track.poses, num_threads, &evidence, &initialization);
      track.seconds_calibration += watch.Seconds();
      if (progress && !progress({"proportions", round, num_rounds - 1})) track.cancelled = true;
    }
    if (round > 0 && options.hold_standing_feet) {
      FindStandingFeet(evidence, track.poses, &initialization.observations);
    }
    if (round > 0 && options.test_depth_flips) ChooseLimbs(evidence, initialization, &track.poses);
    const bool last_round = round + 1 == num_rounds;
    if (round > 0 && last_round) evidence.DiscountLasting();
    BatchSolveOptions rough_solver = options.batch_solver;
    rough_solver.relative_tolerance *= kRoughTolerance;
    const double max_adaptations = options.adaptive_band && last_round ? kMaxAdaptations : 0;
    std::vector<Eigen::MatrixXd> solved(windows.size());
    // Groups of a few windows keep the threads busy and let the callback stop between them.
    const int group = 4 * num_threads;
    for (int first = 0; first < track.num_windows && !track.cancelled; first += group) {
      const int count = std::min(group, track.num_windows - first);
      ParallelFor(count, num_threads, [&](int i) {
        const Window& window = windows[first + i];
        BatchProblem problem =
            MakeWindowProblem(evidence, initialization, window, track.poses, before);
        solved[first + i] = track.poses.middleCols(window.begin, window.size());
        const long num_adaptations =
            std::lround(max_adaptations * ObservedShare(initialization, window));
        for (long adaptation = 0; adaptation < num_adaptations; ++adaptation) {
          SolveBatch(problem, rough_solver, &solved[first + i]);
          AdaptSmoothness(initialization, window, solved[first + i], &problem);
        }
        SolveBatch(problem, last_round ? options.batch_solver : rough_solver, &solved[first + i]);
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
  track.proportions = calibration.proportions();
  track.error_2d_mm = evidence.error_2d_mm();
  track.uncertainty = calibration.uncertainty();
  track.seconds_batch = batch_watch.Seconds() - track.seconds_calibration;

  for (int f = 0; f < evidence.num_frames(); ++f) {
    track.frames.push_back(
        ReportFrame(evidence, initialization, detections2d, track.poses.col(f), f));
  }
  return track;
}

}  // namespace mpc
