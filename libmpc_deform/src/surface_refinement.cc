#include "mpc/deform/surface_refinement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "mpc/core/error.h"
#include "mpc/deform/surface_solver.h"

namespace mpc {
namespace {

// Of solves before the last, which only tell where to look for correspondences next.
constexpr double kGuideTolerance = 0.1;
constexpr double kLeastCloth_m = 0.03;
// Cloth in flight, which the usual weights leave behind.
constexpr double kFar_m = 0.015;
constexpr double kVeryFar_m = 0.04;
constexpr double kFarShare = 0.03;
constexpr double kFlight_m = 0.08;  // in place of kLeastCloth_m

void WeighByDistance(double deviations, double least_m, Correspondences* correspondences) {
  const double scale = std::max(RobustScale(*correspondences, deviations), least_m);
  for (int c = 0; c < correspondences->size(); ++c) {
    const double q = correspondences->distances[c] / scale;
    correspondences->weights[c] /= (1 + q * q) * (1 + q * q);
  }
}

bool SomeIsFar(const Correspondences& correspondences, double far_m) {
  double far = 0;
  for (int c = 0; c < correspondences.size(); ++c) {
    if (std::abs(correspondences.distances[c]) > far_m) far += correspondences.weights[c];
  }
  return far > kFarShare * correspondences.weights.sum();
}

// Per vertex, over the nodes that it shares with those of the correspondences.
Eigen::VectorXf Evidence(const DeformationGraph& graph, const Correspondences& correspondences) {
  const auto for_nodes = [&graph](int v, const auto& visit) {
    for (Eigen::Index k = 0; k < graph.weights.rows() && graph.weights(k, v) > 0; ++k) {
      visit(graph.influences(k, v), graph.weights(k, v));
    }
  };
  Eigen::VectorXf of_nodes = Eigen::VectorXf::Zero(graph.num_nodes());
  for (int c = 0; c < correspondences.size(); ++c) {
    const auto weight = static_cast<float>(correspondences.weights[c]);
    for_nodes(correspondences.vertices[static_cast<size_t>(c)],
              [&](int node, float share) { of_nodes[node] += share * weight; });
  }
  Eigen::VectorXf evidence = Eigen::VectorXf::Zero(graph.num_vertices());
  for (int v = 0; v < graph.num_vertices(); ++v) {
    for_nodes(v, [&](int node, float share) { evidence[v] += share * of_nodes[node]; });
  }
  return evidence;
}

}  // namespace

SurfaceRefinementOptions SurfaceRefinementOptions::Paper() {
  SurfaceRefinementOptions options;
  options.flight_arap_weight = 0;
  options.max_flight_rounds = 0;
  options.depth_drift_weight = 0;
  options.side_drift_share = 0;
  options.robust_deviations = 0;
  options.correspondences = CorrespondenceOptions::Paper();
  return options;
}

void SurfaceRefinementOptions::Validate() const {
  correspondences.Validate();
  std::string faults;
  const auto check = [&](bool good, const char* name, double value, const char* expected) {
    if (!good) faults += fmt::format("; {} is {}, expected {}", name, value, expected);
  };
  check(!arap_weights.empty(), "number of arap_weights", 0, "at least 1");
  for (const double weight : arap_weights) {
    check(weight > 0 && std::isfinite(weight), "arap_weights", weight, "positive numbers");
  }
  check(flight_arap_weight >= 0 && std::isfinite(flight_arap_weight), "flight_arap_weight",
        flight_arap_weight, "0 or more");
  check(max_flight_rounds >= 0, "max_flight_rounds", max_flight_rounds, "0 or more");
  check(depth_drift_weight >= 0 && std::isfinite(depth_drift_weight), "depth_drift_weight",
        depth_drift_weight, "0 or more");
  check(side_drift_share >= 0 && std::isfinite(side_drift_share), "side_drift_share",
        side_drift_share, "0 or more");
  check(robust_deviations >= 0 && std::isfinite(robust_deviations), "robust_deviations",
        robust_deviations, "0 or more");
  check(relative_tolerance > 0 && relative_tolerance < 1, "relative_tolerance", relative_tolerance,
        "0 to 1");
  check(max_steps >= 1, "max_steps", max_steps, "1 or more");
  if (!faults.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "surface refinement: " + faults.substr(2));
  }
}

SurfaceRefiner::SurfaceRefiner(const Character& character, DeformationGraph graph,
                               const SurfaceRefinementOptions& options)
    : graph_(std::move(graph)),
      options_(options),
      topology_(SurfaceTopology::FromMesh(character.mesh)),
      parts_(character) {
  options_.Validate();
  if (graph_.num_vertices() != character.mesh.positions.cols()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("surface refinement: a graph of {} vertices for a mesh of {}",
                            graph_.num_vertices(), character.mesh.positions.cols()));
  }
}

SurfaceRefinement SurfaceRefiner::Refine(const Camera& camera, const Eigen::Matrix3Xf& posed,
                                         const Contour2d& silhouette,
                                         CorrespondenceScratch* scratch) const {
  if (posed.cols() != graph_.num_vertices()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("surface refinement: {} vertices, the mesh has {}", posed.cols(),
                            graph_.num_vertices()));
  }
  SurfaceRefinement result;
  result.vertices = posed;
  result.field = WarpField::Identity(graph_.num_nodes());
  const ContourIndex index = IndexSilhouette(silhouette, camera);
  if (index.contour().points.cols() == 0) return result;
  const size_t num_rounds = options_.arap_weights.size();
  const auto max_rounds = num_rounds + static_cast<size_t>(options_.max_flight_rounds);
  Correspondences last;
  bool flies_far = false;  // before the last round
  for (size_t round = 0; round < max_rounds; ++round) {
    const bool only_flight = round >= num_rounds;
    if (only_flight && !flies_far) break;
    const ModelBoundary outline =
        FindOutline(camera, result.vertices, topology_, options_.correspondences, scratch);
    Correspondences correspondences =
        MatchOutline(camera, result.vertices, outline, parts_, index, options_.correspondences);
    if (correspondences.size() == 0) {
      if (result.state != RefinementState::kRefined) {
        result.state = correspondences.num_boundary == 0 ? RefinementState::kNoModel
                                                         : RefinementState::kNoMatch;
      }
      break;
    }
    bool flight = false;
    if (round > 0 && options_.flight_arap_weight > 0) {
      // What no vertex finds is seen from the silhouette only.
      Correspondences both_ways = correspondences;
      AddUnexplained(camera, result.vertices, outline, parts_, index, options_.correspondences,
                     &both_ways);
      flies_far = SomeIsFar(both_ways, kVeryFar_m);
      flight = only_flight ? flies_far : SomeIsFar(both_ways, kFar_m);
      if (flight) correspondences = std::move(both_ways);
    }
    if (only_flight && !flight) break;
    if (options_.robust_deviations > 0) {
      WeighByDistance(options_.robust_deviations, flight ? kFlight_m : kLeastCloth_m,
                      &correspondences);
    }
    const double arap_weight = only_flight ? options_.arap_weights.back()
                               : flight    ? options_.flight_arap_weight
                                           : options_.arap_weights[round];
    const SurfaceProblem problem(camera, graph_, posed, correspondences,
                                 {.arap = arap_weight,
                                  .depth_drift = options_.depth_drift_weight,
                                  .side_drift = options_.side_drift_share * arap_weight},
                                 result.field);
    const bool only_guides = round + 1 < num_rounds;
    const double tolerance =
        std::max(options_.relative_tolerance, only_guides ? kGuideTolerance : 0);
    const SurfaceSolve solve = SolveSurface(problem, tolerance, options_.max_steps, &result.field);
    if (result.state != RefinementState::kRefined) {
      result.state = RefinementState::kRefined;
      result.support = static_cast<double>(correspondences.size()) / correspondences.num_boundary;
      result.cost_before = solve.initial_cost;
    }
    result.cost_after = solve.final_cost;
    result.num_steps += solve.steps;
    WarpVertices(graph_, result.field, posed, &result.vertices);
    last = std::move(correspondences);
  }
  if (result.state == RefinementState::kRefined) result.evidence = Evidence(graph_, last);
  return result;
}

}  // namespace mpc
