// Purpose: the best pose of one frame on its own.
// Source: paper, Section 4, "Initialization and Optimization": min E_2d + E_3d per frame, within
// the angle bounds. Projected Levenberg-Marquardt with an active set for the bounds.
#pragma once

#include <Eigen/Core>

#include "mpc/pose/frame_problem.h"
#include "mpc/pose/summary.h"

namespace mpc {

struct FrameSolveOptions {
  int max_iterations = 30;
  double relative_tolerance = 1e-3;  // stop when an accepted step lowers the cost by less
  bool fixed_root = false;           // hold root translation and rotation
  double initial_damping = 1e-2;     // times the diagonal of the normal equations
};

// Buffers of SolveFrame; reuse them over frames.
struct FrameSolveScratch {
  PosePoint current;
  PosePoint trial;
  FrameScratch evaluation;
  Eigen::MatrixXd hessian;
  Eigen::MatrixXd damped;
  Eigen::VectorXd gradient;
  Eigen::VectorXd step;
};

// Improves `pose` (N, clamped into the bounds first); never makes it worse. A start outside the
// domain returns kFailed with the clamped pose.
SolveSummary SolveFrame(const Skeleton& skeleton, const FrameProblem& problem,
                        const FrameSolveOptions& options, Eigen::VectorXd* pose,
                        FrameSolveScratch* scratch);

}  // namespace mpc
