// Surface refinement of one frame at M = 1000: the product solver beside Ceres with the same
// analytic Jacobians in the same run, the whole stage, and the graph that is built once per actor.
#include <benchmark/benchmark.h>

#include "deform/dressed_person.h"
#include "mpc/deform/surface_refinement.h"
#include "mpc/deform/surface_solver.h"
#include "mpc/seg/contour.h"

namespace mpc {
namespace {

struct Frame {
  testing::DressedPerson person = testing::MakeDressedPerson();
  DeformationGraph graph = BuildDeformationGraph(person.character.mesh);
  Contour2d silhouette = ExtractContour(testing::MaskOf(person, person.truth));
  SurfaceTopology topology = SurfaceTopology::FromMesh(person.character.mesh);
  BodyParts parts{person.character};

  Correspondences Match(const Eigen::Matrix3Xf& vertices) const {
    CorrespondenceScratch scratch;
    return FindCorrespondences(person.camera, vertices, topology, parts,
                               IndexSilhouette(silhouette, person.camera), {}, &scratch);
  }
};

const Frame& TestFrame() {
  static const Frame frame;
  return frame;
}

// Both iterations of the paper: tables, solution with w_arap 0.6; tables, solution with 0.2.
template <typename Solve>
void TwoSolves(benchmark::State& state, const Solve& solve) {
  const Frame& frame = TestFrame();
  const Eigen::Matrix3Xf& posed = frame.person.posed;
  // The same correspondences for both solvers.
  const Correspondences first = frame.Match(posed);
  WarpField field = WarpField::Identity(frame.graph.num_nodes());
  SolveSurface({frame.person.camera, frame.graph, posed, first, {0.6, 2, 0.03}, field}, 1e-3, 12,
               &field);
  Eigen::Matrix3Xf vertices;
  WarpVertices(frame.graph, field, posed, &vertices);
  const Correspondences second = frame.Match(vertices);
  double cost = 0, steps = 0;
  for (auto _ : state) {
    field = WarpField::Identity(frame.graph.num_nodes());
    const SurfaceProblem stiff(frame.person.camera, frame.graph, posed, first, {0.6, 2, 0.03},
                               field);
    steps = solve(stiff, &field).steps;
    const SurfaceProblem soft(frame.person.camera, frame.graph, posed, second, {0.2, 2, 0.01},
                              field);
    const SurfaceSolve last = solve(soft, &field);
    WarpVertices(frame.graph, field, posed, &vertices);
    cost = last.final_cost;
    steps += last.steps;
  }
  state.counters["cost"] = cost;
  state.counters["steps"] = steps;
  state.counters["pairs"] = first.size();
}

void SolveSurface(benchmark::State& state) {
  TwoSolves(state, [](const SurfaceProblem& problem, WarpField* field) {
    return mpc::SolveSurface(problem, 1e-3, 12, field);
  });
}
BENCHMARK(SolveSurface)->Unit(benchmark::kMillisecond);

void SolveSurfaceCeres(benchmark::State& state) {
  TwoSolves(state, [](const SurfaceProblem& problem, WarpField* field) {
    return mpc::SolveSurfaceCeres(problem, 1e-3, 50, field);
  });
}
BENCHMARK(SolveSurfaceCeres)->Unit(benchmark::kMillisecond);

// Correspondences, tables, solutions and warp of all rounds.
void RefineSurface(benchmark::State& state) {
  const Frame& frame = TestFrame();
  const SurfaceRefiner refiner(frame.person.character, frame.graph);
  CorrespondenceScratch scratch;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        refiner.Refine(frame.person.camera, frame.person.posed, frame.silhouette, &scratch));
  }
}
BENCHMARK(RefineSurface)->Unit(benchmark::kMillisecond);

void BuildGraph(benchmark::State& state) {
  const int sides = static_cast<int>(state.range(0));
  const TriangleMesh mesh = testing::Tube({0, 0, 0}, 2, 0.3, 0.3, sides, sides);
  for (auto _ : state) benchmark::DoNotOptimize(BuildDeformationGraph(mesh));
  state.counters["vertices"] = static_cast<double>(mesh.positions.cols());
}
BENCHMARK(BuildGraph)->Arg(55)->Arg(120)->Arg(316)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mpc
