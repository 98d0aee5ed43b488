// Purpose: deform a posed actor so that its outline lies on the silhouette: clothes and soft tissue
// that no pose explains.
// Source: paper, Section 5.3, "Silhouette-based Non-Rigid Surface Refinement": iterated closest
// points, 2 iterations, w_arap 0.6 then 0.2. What is ours, and why: docs/deform.md.
// Frames: camera frame; pixels of the camera's whole picture, centres at integers.
// Units: metres, pixels. Symbols: V vertices, M nodes.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/contour2d.h"
#include "mpc/deform/body_parts.h"
#include "mpc/deform/correspondences.h"
#include "mpc/deform/deformation_graph.h"
#include "mpc/deform/pose_refinement.h"
#include "mpc/render/model_mask.h"
#include "mpc/skeleton/character.h"

namespace mpc {

struct SurfaceRefinementOptions {
  // w_arap of each iteration of correspondences and solution, px^2/mm^2, positive; paper.
  std::vector<double> arap_weights = {0.6, 0.2};
  // w_arap of later iterations, which also reach farther and look from the silhouette too, where more
  // than 3 % of the outline is still more than 1.5 cm off: cloth in flight, px^2/mm^2, >= 0; ours,
  // 0: never (paper).
  double flight_arap_weight = 0.06;
  // Iterations after those, of the last of arap_weights, that reach as far, while more than 3 % of the
  // outline is still more than 4 cm off; ours, 0: none (paper).
  int max_flight_rounds = 2;
  double depth_drift_weight = 2;   // w_ray, px^2/mm^2, >= 0; ours, 0: paper
  double side_drift_share = 0.05;  // w_side by the iteration's w_arap, >= 0; ours, 0: paper
  // Correspondences count less (Geman-McClure) the farther they go, on a scale of so many standard
  // deviations of all distances in the frame, at least 3 cm; 0: all alike (paper).
  double robust_deviations = 6;
  CorrespondenceOptions correspondences = {.max_slant_rad = 0.8};

  double relative_tolerance = 1e-3;  // of the last of arap_weights and later; others end at 0.1
  int max_steps = 12;                // of a solve, >= 1

  // The paper's energy and correspondences.
  static SurfaceRefinementOptions Paper();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

struct SurfaceRefinement {
  Eigen::Matrix3Xf vertices;  // 3xV; the given ones, bit for bit, unless kRefined
  WarpField field;            // of M nodes, from the given vertices; the identity unless kRefined
  RefinementState state = RefinementState::kNoSilhouette;
  double support = 0;      // share of the model's outline with a target, first iteration
  double cost_before = 0;  // E_surf of the first iteration's start and of the last one's end: their
  double cost_after = 0;   // correspondences and weights differ
  int num_steps = 0;       // of all solves
  // Per vertex, V, the weight of the correspondences that move it, 1 being that of an average one:
  // how far the silhouette tells where it is. Empty unless kRefined.
  Eigen::VectorXf evidence;
};

class SurfaceRefiner {
 public:
  // Prepares what all frames share. `graph` is that of the character's mesh. Throws Error
  // (kInvalidArgument) for a graph of another size, a mesh or options that do not validate.
  SurfaceRefiner(const Character& character, DeformationGraph graph,
                 const SurfaceRefinementOptions& options = {});

  // The surface of one frame from the skinned mesh (3xV). Any contour gives a defined result: see
  // RefinementState. Thread-safe with one scratch per thread; the scratch does not change results.
  // Throws Error (kInvalidArgument) for vertices of the wrong number, a contour that is not finite,
  // or a bad camera.
  SurfaceRefinement Refine(const Camera& camera, const Eigen::Matrix3Xf& posed,
                           const Contour2d& silhouette, CorrespondenceScratch* scratch) const;

  const DeformationGraph& graph() const { return graph_; }

 private:
  DeformationGraph graph_;
  SurfaceRefinementOptions options_;
  SurfaceTopology topology_;
  BodyParts parts_;
};

}  // namespace mpc
