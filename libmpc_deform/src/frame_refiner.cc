#include "mpc/deform/frame_refiner.h"

#include <utility>

#include "mpc/deform/temporal_smoothing.h"
#include "mpc/skeleton/skinning.h"

namespace mpc {

FrameRefinementOptions FrameRefinementOptions::Paper() {
  FrameRefinementOptions options;
  options.pose = PoseRefinementOptions::Paper();
  options.surface = SurfaceRefinementOptions::Paper();
  return options;
}

void FrameRefinementOptions::Validate() const {
  pose.Validate();
  graph.Validate();
  surface.Validate();
}

FrameRefiner::FrameRefiner(const Character& character, const FrameRefinementOptions& options)
    : character_(&character),
      level_(options.level),
      pose_refiner_(character, options.pose),
      surface_refiner_(character, BuildDeformationGraph(character.mesh, options.graph),
                       options.surface) {}

FrameRefinement FrameRefiner::Refine(const Camera& camera, const Eigen::VectorXd& batch_pose,
                                     const SilhouetteCallback& silhouette,
                                     CorrespondenceScratch* scratch) const {
  FrameRefinement result;
  result.pose = batch_pose;
  KinematicState state;
  Eigen::Matrix3Xf vertices;
  const auto pose_actor = [&] {
    ForwardKinematics(character_->skeleton, result.pose, &state);
    SkinCharacter(*character_, state, &vertices);
  };
  pose_actor();
  const Contour2d first = silhouette({state, vertices, false});
  if (level_ == RefinementLevel::kNone) return result;

  if (level_ != RefinementLevel::kSurfaceOnly) {
    PoseRefinement pose = pose_refiner_.Refine(camera, batch_pose, first, scratch);
    result.pose_state = pose.state;
    result.pose_support = pose.support;
    if (pose.state == RefinementState::kRefined) {
      result.pose = std::move(pose.pose);
      pose_actor();
    }
  }
  const Contour2d second = silhouette({state, vertices, true});
  if (level_ == RefinementLevel::kPose) return result;

  SurfaceRefinement surface = surface_refiner_.Refine(camera, vertices, second, scratch);
  result.surface_state = surface.state;
  result.surface_support = surface.support;
  if (surface.state == RefinementState::kRefined) {
    result.displacements = surface.vertices - vertices;
    TurnToBind(*character_, state, &result.displacements);
    result.surface = std::move(surface.vertices);
    result.evidence = std::move(surface.evidence);
  }
  return result;
}

}  // namespace mpc
