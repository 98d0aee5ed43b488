// Purpose: the batch problem of one window of a clip.
// Source: paper, Section 4: E_pose of |B| frames; docs/pose.md for the smoothness of each dof.
// Symbols: N dofs, F frames of the clip.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/pose/batch_solver.h"
#include "mpc/pose/clip_evidence.h"
#include "mpc/pose/frame_initializer.h"
#include "mpc/pose/windows.h"

namespace mpc {

// The energies of the window's frames. So far as 3D errors are white, detections are placed on
// `poses` (N x F) of the skeleton `placed_on`.
std::vector<FrameProblem> MakeFrameProblems(const ClipEvidence& evidence,
                                            const FrameInitialization& initialization,
                                            const Window& window, const Eigen::MatrixXd& poses,
                                            const Skeleton& placed_on);

// The same with E_d. `solved` (N x F, or empty): an earlier solution of the clip, whose spectrum then
// gives each dof its smoothness where the options ask for that.
BatchProblem MakeWindowProblem(const ClipEvidence& evidence,
                               const FrameInitialization& initialization, const Window& window,
                               const Eigen::MatrixXd& poses, const Eigen::MatrixXd& solved);

// Share of the window's frames in which somebody was seen.
double ObservedShare(const FrameInitialization& initialization, const Window& window);

// Gives each dof of the window's problem its smoothness from the spectrum of `solved` (N x the
// window's size), an earlier solution of it.
void AdaptSmoothness(const FrameInitialization& initialization, const Window& window,
                     const Eigen::MatrixXd& solved, BatchProblem* problem);

}  // namespace mpc
