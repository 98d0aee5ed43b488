// The only place of pose refinement that knows Ceres.
#include <ceres/ceres.h>

#include <Eigen/Geometry>
#include <cmath>

#include "mpc/core/rigid.h"
#include "mpc/deform/refinement_solver.h"

namespace mpc {
namespace {

// Blocks: root translation (3), root rotation (quaternion x, y, z, w), angles.
class RefinementCost : public ceres::CostFunction {
 public:
  explicit RefinementCost(const RefinementProblem& problem) : problem_(problem) {
    set_num_residuals(problem.num_residuals());
    const int num_dofs = problem.character().skeleton.num_dofs();
    *mutable_parameter_block_sizes() = {3, 4, num_dofs - 6};
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Skeleton& skeleton = problem_.character().skeleton;
    Eigen::VectorXd pose(skeleton.num_dofs());
    pose.head<3>() = Eigen::Vector3d(parameters[0]);
    pose.segment<3>(3).setZero();
    const Eigen::Index num_angles = pose.size() - 6;
    pose.tail(num_angles) = Eigen::Map<const Eigen::VectorXd>(parameters[2], num_angles);
    RefinementPoint point(problem_.character());
    point.Set(skeleton, pose,
              Eigen::Map<const Eigen::Quaterniond>(parameters[1]).normalized().toRotationMatrix());
    Eigen::VectorXd r;
    Eigen::MatrixXd jacobian;
    const double cost = problem_.Evaluate(&point, &r, jacobians == nullptr ? nullptr : &jacobian);
    if (!std::isfinite(cost)) return false;
    Eigen::VectorXd::Map(residuals, num_residuals()) = r;
    if (jacobians == nullptr) return true;
    const auto block = [&](int b) {
      return Eigen::Map<Eigen::MatrixXd>(jacobians[b], parameter_block_sizes()[b], num_residuals());
    };
    if (jacobians[0] != nullptr) block(0) = jacobian.topRows<3>();
    if (jacobians[1] != nullptr) {
      // The manifold turns by twice its step.
      Eigen::Matrix<double, 3, 4, Eigen::RowMajor> step_from_quaternion;
      ceres::EigenQuaternionManifold().MinusJacobian(parameters[1], step_from_quaternion.data());
      block(1) = 2 * step_from_quaternion.transpose() * jacobian.middleRows<3>(3);
    }
    if (jacobians[2] != nullptr) block(2) = jacobian.bottomRows(num_angles);
    return true;
  }

 private:
  const RefinementProblem& problem_;
};

}  // namespace

RefinementSolve SolveRefinementCeres(const RefinementProblem& problem, double relative_tolerance,
                                     int max_steps, Eigen::VectorXd* pose) {
  const Skeleton& skeleton = problem.character().skeleton;
  const Eigen::VectorXd lower = skeleton.LowerBounds(), upper = skeleton.UpperBounds();
  Eigen::VectorXd x = pose->cwiseMax(lower).cwiseMin(upper);
  Eigen::Quaterniond rotation(ExpSO3(pose->segment<3>(3)));
  RefinementSolve result;

  RefinementPoint start(problem.character());
  start.Set(skeleton, x, rotation.toRotationMatrix());
  Eigen::VectorXd r;
  result.initial_cost = problem.Evaluate(&start, &r, nullptr);
  result.failed = !std::isfinite(result.initial_cost);
  if (result.failed) return result;

  ceres::Problem ceres_problem;
  ceres_problem.AddResidualBlock(new RefinementCost(problem), nullptr, x.data(),
                                 rotation.coeffs().data(), x.data() + 6);
  ceres_problem.SetManifold(rotation.coeffs().data(), new ceres::EigenQuaternionManifold);
  for (int n = 6; n < x.size(); ++n) {
    ceres_problem.SetParameterLowerBound(x.data() + 6, n - 6, lower[n]);
    ceres_problem.SetParameterUpperBound(x.data() + 6, n - 6, upper[n]);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.function_tolerance = relative_tolerance;
  options.max_num_iterations = max_steps;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  result.final_cost = 2 * summary.final_cost;
  result.steps = static_cast<int>(summary.iterations.size());
  *pose = x;
  pose->segment<3>(3) = LogSO3(rotation.normalized().toRotationMatrix());
  return result;
}

}  // namespace mpc
