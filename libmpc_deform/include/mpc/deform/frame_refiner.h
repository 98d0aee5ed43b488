// Purpose: the refinement of one frame, all of it: silhouette, pose, silhouette again, surface.
// Source: paper, Section 5; the silhouettes are the caller's.
// Frames: poses and vertices in the camera frame. Units: metres, radians, pixels.
// Symbols: N dofs, V vertices.
#pragma once

#include <Eigen/Core>
#include <functional>

#include "mpc/core/camera.h"
#include "mpc/core/contour2d.h"
#include "mpc/deform/correspondences.h"
#include "mpc/deform/deformation_graph.h"
#include "mpc/deform/pose_refinement.h"
#include "mpc/deform/surface_refinement.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {

enum class RefinementLevel {
  kNone,         // the pose stays as it is: one silhouette is asked for
  kPose,         // the pose only
  kSurface,      // pose and surface; paper
  kSurfaceOnly,  // the surface at the given pose, as the paper does with another method's poses
};

struct FrameRefinementOptions {
  RefinementLevel level = RefinementLevel::kSurface;
  PoseRefinementOptions pose;
  DeformationGraphOptions graph;
  SurfaceRefinementOptions surface;

  static FrameRefinementOptions Paper();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

struct FrameRefinement {
  Eigen::VectorXd pose;                                            // N
  RefinementState pose_state = RefinementState::kNoSilhouette;     // other than kRefined: the pose
  RefinementState surface_state = RefinementState::kNoSilhouette;  // or surface is the given one
  double pose_support = 0;                                         // see PoseRefinement
  double surface_support = 0;
  // From the skinned mesh to the surface, in the axes of the bind pose (TurnToBind); empty when the
  // surface was not refined.
  Eigen::Matrix3Xf displacements;
  Eigen::Matrix3Xf surface;  // 3xV: where the displacements take it; empty when they are
  Eigen::VectorXf evidence;  // V, see SurfaceRefinement; empty when they are
};

// A posed actor, as the caller finds its silhouette: the first time at the batch's pose, the second
// time, if any, at the refined one.
struct PosedActor {
  const KinematicState& state;
  const Eigen::Matrix3Xf& vertices;  // 3xV
  bool refined = false;
};

// The outline of the person in the picture; an empty one leaves pose or surface as it is.
using SilhouetteCallback = std::function<Contour2d(const PosedActor&)>;

class FrameRefiner {
 public:
  // Prepares what all frames share, the deformation graph among it. Refers to `character`, which
  // must outlive it. Throws Error (kInvalidArgument) as PoseRefiner and BuildDeformationGraph.
  explicit FrameRefiner(const Character& character, const FrameRefinementOptions& options = {});

  // Thread-safe with one scratch per thread. Throws Error (kInvalidArgument) as PoseRefiner and
  // SurfaceRefiner, and what the callback throws.
  FrameRefinement Refine(const Camera& camera, const Eigen::VectorXd& batch_pose,
                         const SilhouetteCallback& silhouette,
                         CorrespondenceScratch* scratch) const;

 private:
  const Character* character_;
  RefinementLevel level_;
  PoseRefiner pose_refiner_;
  SurfaceRefiner surface_refiner_;
};

}  // namespace mpc
