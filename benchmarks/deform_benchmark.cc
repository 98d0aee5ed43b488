// Speed of pose refinement at 1080p: an actor of 14,000 vertices, 900 px tall, whose pose is off by
// some degrees and centimetres. Baseline of the solver: Ceres with the same analytic Jacobians.
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <random>

#include "deform/posed_actor.h"
#include "mpc/deform/pose_refinement.h"
#include "mpc/deform/refinement_solver.h"
#include "mpc/deform/temporal_smoothing.h"

namespace {

using mpc::testing::Camera1080;

// The procedural actor with every third triangle cut into three around its centre: 14,000 vertices.
const mpc::Character& DenseActor() {
  static const mpc::Character dense = [] {
    mpc::Character c = mpc::testing::Actor();
    const mpc::Triangles coarse = c.mesh.triangles;
    const Eigen::Index num_vertices = c.mesh.positions.cols(), num_coarse = coarse.cols();
    const Eigen::Index num_new = num_coarse / 3;
    c.mesh.positions.conservativeResize(3, num_vertices + num_new);
    c.segments.conservativeResize(Eigen::NoChange, num_vertices + num_new);
    c.weights.conservativeResize(Eigen::NoChange, num_vertices + num_new);
    c.mesh.triangles.conservativeResize(3, num_coarse + 2 * num_new);
    for (Eigen::Index i = 0; i < num_new; ++i) {
      const Eigen::Vector3i corner = coarse.col(3 * i);
      const int centre = static_cast<int>(num_vertices + i);
      c.mesh.positions.col(centre) =
          (c.mesh.positions.col(corner[0]) + c.mesh.positions.col(corner[1]) +
           c.mesh.positions.col(corner[2])) /
          3;
      c.segments.col(centre) = c.segments.col(corner[0]);
      c.weights.col(centre) = c.weights.col(corner[0]);
      c.mesh.triangles.col(3 * i) << corner[0], corner[1], centre;
      c.mesh.triangles.col(num_coarse + 2 * i) << corner[1], corner[2], centre;
      c.mesh.triangles.col(num_coarse + 2 * i + 1) << corner[2], corner[0], centre;
    }
    return c;
  }();
  return dense;
}

struct Scene {
  Scene() {
    truth = mpc::testing::MidWalk();
    truth[2] = 3.5;
    start = mpc::testing::Perturbed(truth, 3, 0.05, 0.015);
    silhouette = mpc::testing::SilhouetteOf(camera, DenseActor(), truth);
  }
  mpc::Camera camera = Camera1080();
  Eigen::VectorXd truth, start;
  mpc::Contour2d silhouette;
  mpc::CorrespondenceScratch scratch;
};

void RefinePose(benchmark::State& state) {
  Scene scene;
  const mpc::PoseRefiner refiner(DenseActor());
  mpc::PoseRefinement result;
  for (auto _ : state) {
    result = refiner.Refine(scene.camera, scene.start, scene.silhouette, &scene.scratch);
  }
  state.counters["steps"] = result.num_steps;
  state.counters["cost"] = result.cost_after;
  state.counters["vertices"] = static_cast<double>(DenseActor().mesh.positions.cols());
}
BENCHMARK(RefinePose)->Unit(benchmark::kMicrosecond);

void RefinePosePaper(benchmark::State& state) {
  Scene scene;
  const mpc::PoseRefiner refiner(DenseActor(), mpc::PoseRefinementOptions::Paper());
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        refiner.Refine(scene.camera, scene.start, scene.silhouette, &scene.scratch));
  }
}
BENCHMARK(RefinePosePaper)->Unit(benchmark::kMicrosecond);

void FindCorrespondencesOfAPose(benchmark::State& state) {
  Scene scene;
  const mpc::PoseRefiner refiner(DenseActor());
  const mpc::ContourIndex index = mpc::IndexSilhouette(scene.silhouette, scene.camera);
  const Eigen::Matrix3Xf vertices = mpc::testing::Vertices(DenseActor(), scene.start);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        mpc::FindCorrespondences(scene.camera, vertices, refiner.topology(), refiner.parts(), index,
                                 mpc::PoseRefinementOptions().correspondences, &scene.scratch));
  }
}
BENCHMARK(FindCorrespondencesOfAPose)->Unit(benchmark::kMicrosecond);

// One solve, as in the first iteration.
template <typename Solve>
void RunSolver(benchmark::State& state, const Solve& solve) {
  Scene scene;
  const mpc::PoseRefiner refiner(DenseActor());
  const mpc::Correspondences found = mpc::FindCorrespondences(
      scene.camera, mpc::testing::Vertices(DenseActor(), scene.start), refiner.topology(),
      refiner.parts(), mpc::IndexSilhouette(scene.silhouette, scene.camera),
      mpc::PoseRefinementOptions().correspondences, &scene.scratch);
  const mpc::RefinementProblem problem(
      DenseActor(), mpc::ContourEnergy(scene.camera, found, 20),
      mpc::StabilityEnergy(DenseActor().skeleton, scene.start, 0.06, 0.95));
  mpc::RefinementSolve result;
  for (auto _ : state) {
    Eigen::VectorXd pose = scene.start;
    result = solve(problem, &pose);
  }
  state.counters["steps"] = result.steps;
  state.counters["cost"] = result.final_cost;
}

void SolveRefinementProblem(benchmark::State& state) {
  RunSolver(state, [](const mpc::RefinementProblem& problem, Eigen::VectorXd* pose) {
    const mpc::PoseRefinementOptions options;
    return mpc::SolveRefinement(problem, options.relative_tolerance, options.max_steps, pose);
  });
}
BENCHMARK(SolveRefinementProblem)->Unit(benchmark::kMicrosecond);

void SolveRefinementProblem_BaselineCeres(benchmark::State& state) {
  RunSolver(state, [](const mpc::RefinementProblem& problem, Eigen::VectorXd* pose) {
    return mpc::SolveRefinementCeres(problem, 1e-3, 100, pose);
  });
}
BENCHMARK(SolveRefinementProblem_BaselineCeres)->Unit(benchmark::kMicrosecond);

}  // namespace
