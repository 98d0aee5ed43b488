// Purpose: smooth over time what was refined frame by frame, without flattening the motion.
// Source: paper, end of Section 5: "temporally smoothing the per-frame results based on a centered
// window of 5 frames". Ours: a parabola through the window instead of its mean, and what happens
// beside frames that were not refined (docs/deform.md).
// Frames: any, the same for all. Units: as the input's. Symbols: N dofs, F frames, V vertices.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

struct SmoothingOptions {
  int window_frames = 5;  // centred, odd, 1: no smoothing; paper
  // Degree of the polynomial in time that is fitted to the window, 0 to 2. 1 is the mean of the
  // window, the paper's, which flattens fast motion; both follow a trend at the ends of a clip, where
  // the window has one side only.
  int degree = 2;
  // Seconds to either side over which the depth that silhouettes gave the whole actor is smoothed
  // first, at most 16 frames: it is the least certain of what they say. 0: not at all (paper).
  double depth_seconds = 0.2;
  // Where the outline of a frame shows a surface more than about so far sideways of the smoothed one,
  // metres, it stays there: a blow or a step that no parabola follows. 0: never (paper).
  double keep_m = 0.015;

  // The mean of the window.
  static SmoothingOptions Paper();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

// Weights of the frames of a window (window_frames entries) for the value of the frame in its
// middle. usable: false for frames outside the clip, or whose value is not known. They sum to one
// where the middle is usable or has usable frames on both sides. Beyond the last usable frame on
// one side they fade to zero over the reach of the window: a correction ends gently where
// refinement was refused. Throws Error (kInvalidArgument) for a wrong size.
Eigen::VectorXd SmoothingWeights(const std::vector<bool>& usable, const SmoothingOptions& options);

// The value in the middle of a line through an odd number of values at even steps, weighted by a
// biweight kernel that ends just beyond them; NaN stands for values that are not known. NaN when none
// is known in the middle.
double SmoothedMiddle(const Eigen::VectorXd& values);

// Smoothed poses, N x F, within the skeleton's bounds: translation and angles linearly, rotations of
// the root on SO(3). Where is_refined is false `refined` is not read: the frame first gets the
// correction (refined minus batch) of its neighbours as SmoothingWeights says. Frames without a
// refined one in their window keep the batch's pose. Throws Error (kMismatch) for sizes that differ.
Eigen::MatrixXd SmoothPoses(const Skeleton& skeleton, const Eigen::MatrixXd& batch,
                            const Eigen::MatrixXd& refined, const std::vector<bool>& is_refined,
                            const SmoothingOptions& options);

// Displacements of a posed mesh's vertices (3xV), turned from the axes of the posed body into those
// of the bind pose, where they can be compared between frames, and back. Each vertex turns as
// dual-quaternion skinning turns it. Throws Error (kMismatch) for another number of vertices.
void TurnToBind(const Character& character, const KinematicState& state,
                Eigen::Matrix3Xf* displacements);
void TurnFromBind(const Character& character, const KinematicState& state,
                  Eigen::Matrix3Xf* displacements);

// The smoothed displacements (3xV, in the axes of the bind pose) of the frame in the middle of a
// window of window_frames frames; empty matrices stand for frames outside the clip or that were not
// refined. Empty when all are. Throws Error (kInvalidArgument, kMismatch) for wrong sizes.
Eigen::Matrix3Xf SmoothDisplacements(std::span<const Eigen::Matrix3Xf> window,
                                     const SmoothingOptions& options);

// Moves a smoothed surface (3xV, camera frame) sideways, its depth stays, towards the surface that
// was refined in this frame: by q^2 / (1 + q^2) e / (e + 3) of the way, q = the way in keep_m, e = the
// evidence of the frame's outline (V, SurfaceRefinement::evidence). Throws Error (kMismatch) for
// sizes that differ.
void KeepSeen(const Eigen::Matrix3Xf& refined, const Eigen::VectorXf& evidence, double keep_m,
              Eigen::Matrix3Xf* smoothed);

}  // namespace mpc
