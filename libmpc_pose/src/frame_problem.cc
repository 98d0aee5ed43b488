#include "mpc/pose/frame_problem.h"

#include <limits>

namespace mpc {

int FrameProblem::num_residuals() const {
  return reprojection.num_residuals() + joint_positions.num_residuals() +
         bone_vectors.num_residuals() + rest_prior.num_residuals() + track_prior.num_residuals();
}

FrameProblem FrameProblem::Restricted(const std::vector<int>& joint_index,
                                      const std::vector<int>& hinges) const {
  FrameProblem restricted;
  restricted.reprojection = reprojection.Restricted(joint_index);
  restricted.bone_vectors = bone_vectors.Restricted(joint_index);
  restricted.rest_prior = rest_prior.Restricted(hinges);
  return restricted;
}

double EvaluateFrame(const FrameProblem& problem, const PosePoint& at, FrameScratch* scratch,
                     Eigen::MatrixXd* hessian, Eigen::VectorXd* gradient) {
  const int num_residuals = problem.num_residuals();
  scratch->residuals.resize(num_residuals);
  Eigen::MatrixXd* jacobian = nullptr;
  if (hessian != nullptr) {
    jacobian = &scratch->jacobian;
    jacobian->setZero(num_residuals, at.pose.size());
  }
  int row = 0;
  const auto add = [&](const auto& energy) {
    if (!energy.Evaluate(at, row, &scratch->residuals, jacobian)) return false;
    row += energy.num_residuals();
    return true;
  };
  if (!add(problem.reprojection) || !add(problem.joint_positions) || !add(problem.bone_vectors) ||
      !add(problem.rest_prior) || !add(problem.track_prior)) {
    return std::numeric_limits<double>::infinity();
  }
  if (hessian != nullptr) {
    hessian->setZero(at.pose.size(), at.pose.size());
    hessian->selfadjointView<Eigen::Lower>().rankUpdate(jacobian->transpose());
    hessian->triangularView<Eigen::StrictlyUpper>() = hessian->transpose();
    gradient->noalias() = jacobian->transpose() * scratch->residuals;
  }
  return scratch->residuals.squaredNorm();
}

}  // namespace mpc
