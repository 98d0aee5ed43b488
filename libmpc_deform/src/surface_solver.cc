#include "mpc/deform/surface_solver.h"

#include <cmath>

#include "surface_step.h"

namespace mpc {
namespace {

constexpr double kFirstDamping = 1e-6;
constexpr double kLeastDamping = 1e-8;
constexpr double kMostDamping = 1e4;

}  // namespace

SurfaceSolve SolveSurface(const SurfaceProblem& problem, double relative_tolerance, int max_steps,
                          WarpField* field) {
  SurfaceSolve solve;
  solve.initial_cost = solve.final_cost = problem.Cost(*field);
  solve.failed = !std::isfinite(solve.initial_cost);
  if (solve.failed) return solve;
  SurfaceStep step(problem);
  double damping = kFirstDamping;
  while (solve.steps < max_steps) {
    if (!step.Linearize(*field)) break;
    WarpField next;
    double cost = 0;
    for (; damping < kMostDamping; damping *= 10) {
      next = step.Step(*field, damping);
      cost = problem.Cost(next);
      if (cost < solve.final_cost) break;
    }
    if (!(cost < solve.final_cost)) break;
    const double gain = solve.final_cost - cost;
    *field = std::move(next);
    solve.final_cost = cost;
    ++solve.steps;
    if (gain <= relative_tolerance * (cost + gain)) break;
    damping = std::max(damping / 10, kLeastDamping);
  }
  return solve;
}

}  // namespace mpc
