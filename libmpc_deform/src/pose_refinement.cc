#include "mpc/deform/pose_refinement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "mpc/core/error.h"
#include "mpc/deform/refinement_solver.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"
#include "mpc/skeleton/skinning_jacobian.h"

namespace mpc {
namespace {

constexpr double kLeastRobust_m = 0.01;
constexpr double kLeastKept = 0.01;         // an outline may say nothing of the depth
constexpr double kIndependentPoints = 160;  // of an outline, as far as they tell a depth

// What is kept of E_stab on a common move along the ray makes it the prior that belongs to E_con: one
// over the variance of the batch's depth, beside one over that of the outline's distances.
double FreeDepth(const PoseRefinementOptions& options, double error_px, double depth_m) {
  if (options.depth_deviation == 0) return 0;
  const double deviation_mm = 1000 * depth_m * options.depth_deviation;
  const double kept = error_px / deviation_mm / std::sqrt(kIndependentPoints);
  return 1 - std::clamp(kept / std::sqrt(options.weight_stab), kLeastKept, 1.0);
}

// Moves the outline's vertices, and their pixels, to where they are now.
void Repose(const Camera& camera, const Character& character, const KinematicState& state,
            ModelBoundary* outline, Eigen::Matrix3Xf* vertices) {
  VertexSkinner skinner(character);
  skinner.Update(state);
  for (size_t i = 0; i < outline->vertices.size(); ++i) {
    const int v = outline->vertices[i];
    const Eigen::Vector3d x = skinner.Position(v);
    vertices->col(v) = x.cast<float>();
    Eigen::Vector2d pixel;
    if (Project(camera, x, &pixel)) outline->pixels.col(static_cast<Eigen::Index>(i)) = pixel;
  }
}

}  // namespace

PoseRefinementOptions PoseRefinementOptions::Paper() {
  PoseRefinementOptions options;
  options.depth_deviation = 0;
  options.refresh_outline = true;
  options.robust_m = 0;
  options.correspondences = CorrespondenceOptions::Paper();
  options.relative_tolerance = 1e-6;
  options.max_steps = 100;
  return options;
}

void PoseRefinementOptions::Validate() const {
  correspondences.Validate();
  std::string faults;
  const auto check = [&](bool good, const char* name, double value, const char* expected) {
    if (good) return;
    faults +=
        fmt::format("{}{} is {}, expected {}", faults.empty() ? "" : "; ", name, value, expected);
  };
  check(num_iterations >= 1, "num_iterations", num_iterations, "at least 1");
  check(weight_stab > 0 && std::isfinite(weight_stab), "weight_stab", weight_stab,
        "a positive number");
  check(depth_deviation >= 0 && depth_deviation <= 1, "depth_deviation", depth_deviation, "0 to 1");
  check(robust_deviations > 0, "robust_deviations", robust_deviations, "a positive number");
  check(robust_m >= 0 && std::isfinite(robust_m), "robust_m", robust_m, "at least 0");
  check(relative_tolerance > 0, "relative_tolerance", relative_tolerance, "a positive number");
  check(max_steps >= 1, "max_steps", max_steps, "at least 1");
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "pose refinement: " + faults);
}

const char* RefinementStateName(RefinementState state) {
  switch (state) {
    case RefinementState::kRefined:
      return "refined";
    case RefinementState::kNoSilhouette:
      return "no silhouette";
    case RefinementState::kNoModel:
      return "no model";
    case RefinementState::kNoMatch:
      return "no match";
  }
  return "unknown";
}

PoseRefiner::PoseRefiner(const Character& character, const PoseRefinementOptions& options)
    : character_(&character),
      options_(options),
      topology_(SurfaceTopology::FromMesh(character.mesh)),
      parts_(character) {
  options_.Validate();
}

PoseRefinement PoseRefiner::Refine(const Camera& camera, const Eigen::VectorXd& batch_pose,
                                   const Contour2d& silhouette,
                                   CorrespondenceScratch* scratch) const {
  const Skeleton& skeleton = character_->skeleton;
  if (!batch_pose.allFinite()) {
    throw Error(ErrorCode::kInvalidArgument, "pose refinement: the batch pose is not finite");
  }
  KinematicState state;
  ForwardKinematics(skeleton, batch_pose, &state);
  const ContourIndex outline = IndexSilhouette(silhouette, camera);
  const double px_per_m = 1920.0 / std::max(camera.width, camera.height) *
                          std::max(camera.fx, camera.fy) / std::abs(batch_pose[2]);

  PoseRefinement result;
  result.pose = batch_pose;
  Eigen::VectorXd pose = batch_pose;
  Eigen::Matrix3Xf vertices;
  ModelBoundary model;
  double free_depth = 0;
  for (int i = 0; i < options_.num_iterations; ++i) {
    if (i > 0) ForwardKinematics(skeleton, pose, &state);
    if (i == 0 || options_.refresh_outline) {
      SkinCharacter(*character_, state, &vertices);
      model = FindOutline(camera, vertices, topology_, options_.correspondences, scratch);
    } else {
      Repose(camera, *character_, state, &model, &vertices);
    }
    const Correspondences found =
        MatchOutline(camera, vertices, model, parts_, outline, options_.correspondences);
    if (found.size() == 0) {
      result.state = outline.contour().points.cols() == 0 ? RefinementState::kNoSilhouette
                     : found.num_boundary == 0            ? RefinementState::kNoModel
                                                          : RefinementState::kNoMatch;
      return result;
    }
    const double robust_m =
        std::min(options_.robust_m,
                 std::max(RobustScale(found, options_.robust_deviations), kLeastRobust_m));
    if (i == 0) {
      free_depth = FreeDepth(options_, px_per_m * RobustScale(found, 1), std::abs(batch_pose[2]));
    }
    const StabilityEnergy stability(skeleton, batch_pose, options_.weight_stab, free_depth);
    const RefinementProblem problem(*character_, ContourEnergy(camera, found, robust_m * px_per_m),
                                    stability);
    const RefinementSolve solve =
        SolveRefinement(problem, options_.relative_tolerance, options_.max_steps, &pose);
    if (solve.failed) {
      result.state = RefinementState::kNoModel;
      return result;
    }
    if (i == 0) {
      result.cost_before = solve.initial_cost;
      result.support = found.weights.sum() / found.num_boundary;
    }
    result.cost_after = solve.final_cost;
    result.num_steps += solve.steps;
  }
  result.pose = pose;
  result.state = RefinementState::kRefined;
  return result;
}

}  // namespace mpc
