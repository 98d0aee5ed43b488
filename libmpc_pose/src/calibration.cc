#include "mpc/pose/calibration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "mpc/core/rigid.h"
#include "mpc/pose/frame_solver.h"

namespace mpc {
namespace {

using PartVector = Eigen::Matrix<double, kNumBodyParts, 1>;
using PartMatrix = Eigen::Matrix<double, kNumBodyParts, kNumBodyParts>;

constexpr int kMaxFrames = 40;
constexpr int kMaxIterations = 8;
constexpr double kStep = 1e-4;  // of the difference quotient in log scale; joints are linear in it
// Spread of people's relative limb lengths around a template's.
constexpr double kPriorSigma = 0.08;
// A detector's errors last for a second: a clip's frames count as this many independent ones.
constexpr double kIndependentFrames = 10;

Proportions FromLog(const PartVector& log_scale) {
  Proportions proportions;
  for (int p = 0; p < kNumBodyParts; ++p) proportions.part[p] = std::exp(log_scale[p]);
  return proportions;
}

std::vector<int> SpreadFrames(const FrameInitialization& initialization) {
  std::vector<int> usable;
  for (size_t f = 0; f < initialization.observed.size(); ++f) {
    if (initialization.observed[f]) usable.push_back(static_cast<int>(f));
  }
  const int count = std::min<int>(kMaxFrames, static_cast<int>(usable.size()));
  std::vector<int> frames;
  frames.reserve(count);
  for (int i = 0; i < count; ++i) {
    frames.push_back(usable[static_cast<size_t>(i) * usable.size() / count]);
  }
  return frames;
}

// The clip's problem for one set of scales.
class Calibrator {
 public:
  Calibrator(const ClipEvidence& evidence, const FrameInitialization& initialization)
      : evidence_(evidence),
        swaps_(initialization.swaps),
        frames_(SpreadFrames(initialization)),
        rest_(RelaxedPose(evidence.skeleton())) {
    for (const int f : frames_) {
      poses.push_back(initialization.poses.col(f));
      depths_.push_back(PersonDepth(poses.back()));
    }
  }

  int num_frames() const { return static_cast<int>(frames_.size()); }

  ClipEvidence Scaled(const PartVector& log_scale) const {
    return evidence_.ForSkeleton(ScaledSkeleton(evidence_.skeleton(), FromLog(log_scale)));
  }

  FrameProblem Problem(const ClipEvidence& scaled, int i) const {
    const Eigen::Vector3d hips = poses[i].head<3>();
    return scaled.MakeProblem(scaled.Observe(frames_[i], swaps_[frames_[i]], &hips), depths_[i],
                              /*loss_width=*/1, rest_);
  }

  // Best poses for the scales; returns the cost of frames and prior.
  double SolvePoses(const ClipEvidence& scaled, const PartVector& log_scale,
                    std::vector<Eigen::VectorXd>* solved) {
    double cost = 0;
    for (int i = 0; i < num_frames(); ++i) {
      cost += SolveFrame(scaled.skeleton(), Problem(scaled, i), evidence_.options().frame_solver,
                         &(*solved)[i], &scratch_)
                  .final_cost;
    }
    return DataWeight() * cost + log_scale.squaredNorm() / (kPriorSigma * kPriorSigma);
  }

  // Gauss-Newton system of the scales with the poses eliminated.
  void Reduce(const PartVector& log_scale, PartMatrix* hessian, PartVector* gradient) {
    const ClipEvidence base = Scaled(log_scale);
    std::vector<ClipEvidence> stepped;
    stepped.reserve(kNumBodyParts);
    for (int p = 0; p < kNumBodyParts; ++p) {
      stepped.push_back(Scaled(log_scale + kStep * PartVector::Unit(p)));
    }
    hessian->setZero();
    gradient->setZero();
    const Eigen::VectorXd lower = base.skeleton().LowerBounds();
    const Eigen::VectorXd upper = base.skeleton().UpperBounds();
    for (int i = 0; i < num_frames(); ++i) {
      PosePoint point;
      point.pose = poses[i];
      point.root_rotation = ExpSO3(poses[i].segment<3>(3));
      point.Update(base.skeleton(), /*with_jacobian=*/true);
      Eigen::MatrixXd pose_hessian;
      Eigen::VectorXd pose_gradient;
      FrameScratch frame;
      EvaluateFrame(Problem(base, i), point, &frame, &pose_hessian, &pose_gradient);

      Eigen::MatrixXd scale_jacobian(frame.residuals.size(), kNumBodyParts);
      for (int p = 0; p < kNumBodyParts; ++p) {
        point.Update(stepped[p].skeleton(), /*with_jacobian=*/false);
        FrameScratch moved;
        EvaluateFrame(Problem(stepped[p], i), point, &moved);
        if (moved.residuals.size() != frame.residuals.size()) return;  // w_f switched: no step
        scale_jacobian.col(p) = (moved.residuals - frame.residuals) / kStep;
      }
      // Dofs held at a bound do not give way.
      Eigen::MatrixXd jacobian = frame.jacobian;
      for (int n = 0; n < pose_gradient.size(); ++n) {
        const bool pinned = (poses[i][n] <= lower[n] && pose_gradient[n] > 0) ||
                            (poses[i][n] >= upper[n] && pose_gradient[n] < 0);
        if (!pinned) continue;
        jacobian.col(n).setZero();
        pose_hessian.row(n).setZero();
        pose_hessian.col(n).setZero();
      }
      pose_hessian.diagonal().array() += 1e-6 * pose_hessian.diagonal().maxCoeff();
      const Eigen::MatrixXd cross = jacobian.transpose() * scale_jacobian;
      const Eigen::MatrixXd eliminated = pose_hessian.ldlt().solve(cross);
      *hessian += scale_jacobian.transpose() * scale_jacobian - cross.transpose() * eliminated;
      *gradient += scale_jacobian.transpose() * frame.residuals -
                   eliminated.transpose() * (jacobian.transpose() * frame.residuals);
    }
    *hessian *= DataWeight();
    *gradient *= DataWeight();
    hessian->diagonal().array() += 1 / (kPriorSigma * kPriorSigma);
    *gradient += log_scale / (kPriorSigma * kPriorSigma);
  }

  std::vector<Eigen::VectorXd> poses;

 private:
  // Turns the sum of frame costs into chi^2 of kIndependentFrames frames.
  double DataWeight() const {
    return std::min(1.0, kIndependentFrames / num_frames()) / kNoiseCost;
  }

  const ClipEvidence& evidence_;
  const std::vector<SideSwap>& swaps_;
  std::vector<int> frames_;
  std::vector<double> depths_;
  Eigen::VectorXd rest_;
  FrameSolveScratch scratch_;
};

}  // namespace

CalibrationResult CalibrateProportions(const ClipEvidence& evidence,
                                       const FrameInitialization& initialization,
                                       const ProgressCallback& progress) {
  CalibrationResult result;
  Calibrator calibrator(evidence, initialization);
  PartVector log_scale = PartVector::Zero();
  PartMatrix hessian = PartMatrix::Identity() / (kPriorSigma * kPriorSigma);
  if (calibrator.num_frames() > 0) {
    double cost = calibrator.SolvePoses(evidence, log_scale, &calibrator.poses);
    for (int iteration = 0; iteration < kMaxIterations && !result.cancelled; ++iteration) {
      if (progress) result.cancelled = !progress({"proportions", iteration, kMaxIterations});
      PartVector gradient;
      calibrator.Reduce(log_scale, &hessian, &gradient);
      const PartVector step = -hessian.ldlt().solve(gradient);
      const PartVector trial =
          (log_scale + step).cwiseMax(-3 * kPriorSigma).cwiseMin(3 * kPriorSigma);
      std::vector<Eigen::VectorXd> poses = calibrator.poses;
      const double trial_cost = calibrator.SolvePoses(calibrator.Scaled(trial), trial, &poses);
      if (!(trial_cost < cost)) break;
      const bool converged = (trial - log_scale).cwiseAbs().maxCoeff() < 2e-3;
      cost = trial_cost;
      log_scale = trial;
      calibrator.poses = std::move(poses);
      if (converged) break;
    }
    if (progress && !result.cancelled) {
      result.cancelled = !progress({"proportions", kMaxIterations, kMaxIterations});
    }
  }
  result.proportions = FromLog(log_scale);
  const PartMatrix covariance = hessian.inverse();
  for (int p = 0; p < kNumBodyParts; ++p) {
    result.uncertainty.part[p] = std::sqrt(std::max(0.0, covariance(p, p)));
  }
  return result;
}

}  // namespace mpc
