// Purpose: move a posed actor so that its outline lies on the silhouette of its picture.
// Source: paper, Section 5.2, "Silhouette-based Pose Refinement": iterated closest points, 3
// iterations from the batch pose. What is ours, and why: docs/deform.md.
// Frames: poses in the camera frame; pixels of the camera's whole picture, centres at integers.
// Units: metres, radians, pixels. Symbols: N dofs.
#pragma once

#include <Eigen/Core>

#include "mpc/core/camera.h"
#include "mpc/core/contour2d.h"
#include "mpc/deform/body_parts.h"
#include "mpc/deform/correspondences.h"
#include "mpc/render/model_mask.h"
#include "mpc/skeleton/character.h"

namespace mpc {

struct PoseRefinementOptions {
  int num_iterations = 3;     // of correspondences and solution, >= 1; paper
  double weight_stab = 0.06;  // w_stab; paper
  // Standard deviation of the batch's depth of the whole actor, in its distance from the camera. E_stab
  // leaves that move free so far as the outline tells it better; 0: not at all (paper). In [0, 1].
  double depth_deviation = 0.01;
  // Scale of the robust loss on distances from the silhouette: so many of their standard deviations
  // in the frame, at least 1 cm and at most robust_m, m at the actor; robust_m 0: squares (paper).
  double robust_deviations = 4;
  double robust_m = 0.05;
  // Which vertices are the outline: found once, from the batch pose; true: again in every iteration
  // (paper).
  bool refresh_outline = false;
  // One vertex per 2 cm of outline is enough for a skeleton, and hidden ones do no harm: a third of
  // the time.
  CorrespondenceOptions correspondences = {
      .min_spacing_m = 0.02, .weigh_by_length = false, .drop_hidden = false};

  double relative_tolerance = 3e-3;  // of a solve: its last step lowers E_ref by less
  int max_steps = 10;                // of a solve, >= 1

  // The paper's energies and correspondences, solved to the end.
  static PoseRefinementOptions Paper();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

enum class RefinementState {
  kRefined,
  kNoSilhouette,  // the contour has no point inside the picture
  kNoModel,       // no outline of the model is seen: outside the picture, or behind the camera
  kNoMatch,       // the outlines do not belong together, such as another person's silhouette
};

// Short lower-case name, such as "no match".
const char* RefinementStateName(RefinementState state);

struct PoseRefinement {
  Eigen::VectorXd pose;  // N; the given one, bit for bit, unless kRefined
  RefinementState state = RefinementState::kNoSilhouette;
  double support = 0;      // share of the model's outline with a target, first iteration
  double cost_before = 0;  // E_ref of the first iteration's start and of the last one's end: their
  double cost_after = 0;   // correspondences differ
  int num_steps = 0;       // of all solves
};

class PoseRefiner {
 public:
  // Prepares what all frames share. Refers to `character`, which must outlive it. Throws Error
  // (kInvalidArgument) for a mesh that does not validate, or options that do not.
  explicit PoseRefiner(const Character& character, const PoseRefinementOptions& options = {});

  // The pose of one frame, from the batch's (N). Any contour gives a defined result: see
  // RefinementState. Thread-safe with one scratch per thread; the scratch does not change results.
  // Throws Error (kInvalidArgument) for a pose of the wrong size, a contour that is not finite, or
  // a bad camera.
  PoseRefinement Refine(const Camera& camera, const Eigen::VectorXd& batch_pose,
                        const Contour2d& silhouette, CorrespondenceScratch* scratch) const;

  const SurfaceTopology& topology() const { return topology_; }
  const BodyParts& parts() const { return parts_; }

 private:
  const Character* character_;
  PoseRefinementOptions options_;
  SurfaceTopology topology_;
  BodyParts parts_;
};

}  // namespace mpc
