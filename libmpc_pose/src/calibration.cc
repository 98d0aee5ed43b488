#include "mpc/pose/calibration.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "mpc/core/thread_pool.h"
#include "window_problem.h"

namespace mpc {
namespace {

constexpr int kMaxWindows = 8;
constexpr double kStep = 1e-4;  // of the difference quotients in log scale; joints are linear in it
// Spread of people's relative limb lengths around a template's.
constexpr double kPriorSigma = 0.08;
// The same for parts that errors of seconds drown: the widths of the trunk, which are seen only
// together with its turn, and the feet, of few points close together.
constexpr double kSmallPartSigma = 0.04;
// A part moves by (1 - (kDoubt sigma / x)^2) x: not at all where x is no more than that much noise.
constexpr double kDoubt = 0.5;
constexpr double kMaxLogScale = 3 * kPriorSigma;
constexpr double kStatureSigma = 1e-3;
// Errors that last for seconds: a clip's frames count as this many independent ones.
constexpr double kIndependentFrames = 5;
// Lasting errors leave residuals of at least this share of a typical error's cost; exact detections a
// tenth of that.
constexpr double kUsualResidual = 0.2;
constexpr double kMinLasting = 0.05;

bool IsSmall(BodyPart part) {
  return part == BodyPart::kShoulders || part == BodyPart::kHips || part == BodyPart::kFoot;
}

double Precision(double sigma) { return 1 / (sigma * sigma); }

Proportions FromLog(const Eigen::Matrix<double, kNumBodyParts, 1>& log_scale) {
  Proportions proportions;
  for (int p = 0; p < kNumBodyParts; ++p) proportions.part[p] = std::exp(log_scale[p]);
  return proportions;
}

std::vector<Window> SpreadWindows(const std::vector<Window>& windows) {
  const size_t count = std::min<size_t>(kMaxWindows, windows.size());
  std::vector<Window> spread;
  for (size_t i = 0; i < count; ++i) spread.push_back(windows[i * windows.size() / count]);
  return spread;
}

FrameInitialization Rescaled(const ClipEvidence& evidence, FrameInitialization initialization) {
  for (FrameObservation& observation : initialization.observations) {
    observation = evidence.Rescaled(observation);
  }
  return initialization;
}

}  // namespace

ProportionsCalibration::ProportionsCalibration(const Skeleton& rig) : rig_(rig) {
  uncertainty_.part.fill(kPriorSigma);
}

Proportions ProportionsCalibration::proportions() const { return FromLog(log_scale_); }

Skeleton ProportionsCalibration::Scaled(const PartVector& log_scale) const {
  return ScaledSkeleton(rig_, FromLog(log_scale));
}

// Height of the head's top over the ankles at rest; of a skeleton without them it is not known and
// taken as constant.
double ProportionsCalibration::LogStature(const PartVector& log_scale) const {
  const Skeleton skeleton = Scaled(log_scale);
  const int head = skeleton.FindJointIndex(JointId::kHeadTop);
  const int left = skeleton.FindJointIndex(JointId::kLeftAnkle);
  const int right = skeleton.FindJointIndex(JointId::kRightAnkle);
  if (head < 0 || left < 0 || right < 0) return 0;
  KinematicState rest;
  ForwardKinematics(skeleton, ZeroPose(skeleton), &rest);
  return std::log(rest.joints(1, head) - 0.5 * (rest.joints(1, left) + rest.joints(1, right)));
}

void ProportionsCalibration::Step(const std::vector<Window>& windows, const Eigen::MatrixXd& poses,
                                  int num_threads, ClipEvidence* evidence,
                                  FrameInitialization* initialization) {
  std::vector<ClipEvidence> stepped;
  std::vector<FrameInitialization> stepped_initialization;
  PartVector stature_slope;
  const double log_stature = LogStature(log_scale_);
  for (int p = 0; p < kNumBodyParts; ++p) {
    const PartVector log_scale = log_scale_ + kStep * PartVector::Unit(p);
    stepped.push_back(evidence->ForSkeleton(Scaled(log_scale)));
    stepped_initialization.push_back(Rescaled(stepped.back(), *initialization));
    stature_slope[p] = (LogStature(log_scale) - log_stature) / kStep;
  }

  const std::vector<Window> spread = SpreadWindows(windows);
  std::vector<ReducedSystem> reduced(spread.size());
  ParallelFor(static_cast<int>(spread.size()), num_threads, [&](int i) {
    const Window& window = spread[i];
    std::vector<SteppedProblem> moved;
    moved.reserve(kNumBodyParts);
    for (int p = 0; p < kNumBodyParts; ++p) {
      moved.push_back(
          {stepped[p].skeleton(), MakeFrameProblems(stepped[p], stepped_initialization[p], window,
                                                    poses, evidence->skeleton())});
    }
    reduced[i] = ReduceBatch(MakeWindowProblem(*evidence, *initialization, window, poses, poses),
                             poses.middleCols(window.begin, window.size()), moved, kStep);
  });

  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(kNumBodyParts, kNumBodyParts);
  PartVector gradient = PartVector::Zero();
  double num_frames = 0;
  double data_cost = 0;
  double num_residuals = 1e-9;
  for (size_t i = 0; i < spread.size(); ++i) {
    hessian += reduced[i].hessian;
    gradient += reduced[i].gradient;
    num_frames += spread[i].size();
    data_cost += reduced[i].data_cost;
    num_residuals += reduced[i].num_residuals;
  }
  // The sum of costs as chi^2 of as many frames as are independent. So far as the residuals are less
  // than lasting errors leave, errors are not there.
  const double white = evidence->white_share();
  const double lasting =
      (1 - white) *
      std::clamp(data_cost / (num_residuals * kNoiseCost * kUsualResidual), kMinLasting, 1.0);
  const double independent =
      white + (1 - white) * std::min(1.0, kIndependentFrames / (num_frames * lasting));
  hessian *= independent / kNoiseCost;
  gradient *= independent / kNoiseCost;
  PartVector precision;
  for (int p = 0; p < kNumBodyParts; ++p) {
    precision[p] = Precision(kPriorSigma);
    if (!IsSmall(static_cast<BodyPart>(p))) continue;
    precision[p] += lasting * (Precision(kSmallPartSigma) - Precision(kPriorSigma));
  }
  hessian.diagonal() += precision;
  gradient += precision.cwiseProduct(log_scale_);
  hessian += Precision(kStatureSigma) * stature_slope * stature_slope.transpose();
  gradient +=
      Precision(kStatureSigma) * stature_slope * (log_stature - LogStature(PartVector::Zero()));

  log_scale_ -= hessian.ldlt().solve(gradient);
  log_scale_ = log_scale_.cwiseMax(-kMaxLogScale).cwiseMin(kMaxLogScale).eval();
  const PartVector variance = hessian.inverse().diagonal().cwiseMax(0);
  for (int p = 0; p < kNumBodyParts; ++p) {
    uncertainty_.part[p] = std::sqrt(variance[p]);
    const double doubt = kDoubt * kDoubt * variance[p];
    log_scale_[p] *= std::max(0.0, 1 - doubt / std::max(1e-12, log_scale_[p] * log_scale_[p]));
  }
  *evidence = evidence->ForSkeleton(Scaled(log_scale_));
  *initialization = Rescaled(*evidence, std::move(*initialization));
}

}  // namespace mpc
