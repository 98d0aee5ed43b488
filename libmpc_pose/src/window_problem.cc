#include "window_problem.h"

#include <algorithm>
#include <cmath>

#include "mpc/pose/trajectory_basis.h"

namespace mpc {
namespace {

// Share of w_d inside the subspace never quite reaches 1: coefficients stay variables of their own.
constexpr double kMaxBandPenalty = 0.999;

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

}  // namespace

std::vector<FrameProblem> MakeFrameProblems(const ClipEvidence& evidence,
                                            const FrameInitialization& initialization,
                                            const Window& window, const Eigen::MatrixXd& poses,
                                            const Skeleton& placed_on) {
  std::vector<FrameProblem> frames;
  frames.reserve(window.size());
  const Eigen::VectorXd relaxed = RelaxedPose(evidence.skeleton());
  KinematicState state;
  for (int f = window.begin; f < window.end; ++f) {
    const Eigen::VectorXd pose = initialization.poses.col(f);
    // What nobody saw is kept at its interpolation, not pulled to rest.
    const Eigen::VectorXd& rest = initialization.observed[f] ? relaxed : pose;
    ForwardKinematics(placed_on, poses.col(f), &state);
    frames.push_back(evidence.MakeProblem(initialization.observations[f], PersonDepth(pose),
                                          /*loss_width=*/1, rest, &state.joints));
  }
  return frames;
}

double ObservedShare(const FrameInitialization& initialization, const Window& window) {
  const auto first = initialization.observed.begin() + window.begin;
  return static_cast<double>(std::count(first, first + window.size(), true)) / window.size();
}

void AdaptSmoothness(const FrameInitialization& initialization, const Window& window,
                     const Eigen::MatrixXd& solved, BatchProblem* problem) {
  const Eigen::MatrixXd spectrum = SubspaceCoefficients(*problem, solved);
  // What was not observed shows no motion.
  problem->band_penalty = ObservedShare(initialization, window) *
                          AdaptedShares(spectrum, problem->smoothness, kNoiseCost, kMaxBandPenalty);
}

BatchProblem MakeWindowProblem(const ClipEvidence& evidence,
                               const FrameInitialization& initialization, const Window& window,
                               const Eigen::MatrixXd& poses, const Eigen::MatrixXd& solved) {
  BatchProblem problem;
  problem.skeleton = evidence.skeleton();
  problem.frames = MakeFrameProblems(evidence, initialization, window, poses, problem.skeleton);
  SetSmoothness(evidence.options(), evidence.fps(), window.size(), &problem);
  if (solved.size() > 0 && evidence.options().adaptive_band) {
    AdaptSmoothness(initialization, window, solved.middleCols(window.begin, window.size()),
                    &problem);
  }
  return problem;
}

}  // namespace mpc
