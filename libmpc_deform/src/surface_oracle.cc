// The only place of the surface that knows Ceres.
#include <ceres/ceres.h>

#include <cmath>

#include "mpc/core/rigid.h"
#include "mpc/deform/surface_solver.h"

namespace mpc {
namespace {

using Node = Eigen::Matrix<double, 6, 1>;  // rotation vector, translation

// d exp^-1 from the left: how omega in exp(omega) exp(x) follows from a change of x.
Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& x) {
  const double angle = x.norm();
  Eigen::Matrix3d cross;
  cross << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
  if (angle < 1e-4) return Eigen::Matrix3d::Identity() + cross / 2 + cross * cross / 6;
  const double square = angle * angle;
  return Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / square * cross +
         (angle - std::sin(angle)) / (square * angle) * cross * cross;
}

// One block of one energy.
template <typename Energy>
class BlockCost : public ceres::CostFunction {
 public:
  BlockCost(const Energy& energy, int block, WarpField* scratch)
      : energy_(energy), block_(block), scratch_(scratch) {
    set_num_residuals(energy.rows());
    mutable_parameter_block_sizes()->assign(energy.nodes(block).size(), 6);
  }

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const std::span<const int> nodes = energy_.nodes(block_);
    for (size_t k = 0; k < nodes.size(); ++k) {
      const Eigen::Map<const Node> node(parameters[k]);
      scratch_->rotations[nodes[k]] = ExpSO3(node.head<3>());
      scratch_->translations.col(nodes[k]) = node.tail<3>();
    }
    if (jacobians == nullptr) return energy_.Evaluate(*scratch_, block_, residuals, nullptr);
    BlockJacobian jacobian;
    if (!energy_.Evaluate(*scratch_, block_, residuals, &jacobian)) return false;
    for (size_t k = 0; k < nodes.size(); ++k) {
      if (jacobians[k] == nullptr) continue;
      const Eigen::Map<const Node> node(parameters[k]);
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>> out(jacobians[k],
                                                                                energy_.rows(), 6);
      out = jacobian.middleCols<6>(6 * k);
      out.leftCols<3>() = out.leftCols<3>() * LeftJacobian(node.head<3>());
    }
    return true;
  }

 private:
  const Energy& energy_;
  int block_;
  WarpField* scratch_;
};

template <typename Energy>
void AddEnergy(const Energy& energy, WarpField* scratch, std::vector<Node>* nodes,
               ceres::Problem* problem) {
  for (int block = 0; block < energy.num_blocks(); ++block) {
    std::vector<double*> parameters;
    for (const int node : energy.nodes(block)) parameters.push_back((*nodes)[node].data());
    problem->AddResidualBlock(new BlockCost<Energy>(energy, block, scratch), nullptr, parameters);
  }
}

}  // namespace

SurfaceSolve SolveSurfaceCeres(const SurfaceProblem& problem, double relative_tolerance,
                               int max_steps, WarpField* field) {
  SurfaceSolve solve;
  solve.initial_cost = solve.final_cost = problem.Cost(*field);
  solve.failed = !std::isfinite(solve.initial_cost);
  if (solve.failed) return solve;
  std::vector<Node> nodes(problem.num_nodes);
  for (int i = 0; i < problem.num_nodes; ++i) {
    nodes[i] << LogSO3(field->rotations[i]), field->translations.col(i);
  }
  WarpField scratch = *field;
  ceres::Problem ceres_problem;
  AddEnergy(problem.contour, &scratch, &nodes, &ceres_problem);
  AddEnergy(problem.arap, &scratch, &nodes, &ceres_problem);
  AddEnergy(problem.drift, &scratch, &nodes, &ceres_problem);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.max_num_iterations = max_steps;
  options.function_tolerance = relative_tolerance;
  options.gradient_tolerance = 0;
  options.parameter_tolerance = 0;
  options.initial_trust_region_radius = 1e8;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  for (int i = 0; i < problem.num_nodes; ++i) {
    field->rotations[i] = ExpSO3(nodes[i].head<3>());
    field->translations.col(i) = nodes[i].tail<3>();
  }
  solve.final_cost = problem.Cost(*field);
  solve.steps = summary.num_successful_steps - 1;
  return solve;
}

}  // namespace mpc
