#include "mpc/pose/frame_problem.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <numeric>
#include <span>

namespace mpc {

int FrameProblem::num_residuals() const {
  return reprojection.num_residuals() + joint_positions.num_residuals() +
         bone_vectors.num_residuals() + standing.num_residuals() + rest_prior.num_residuals() +
         track_prior.num_residuals();
}

FrameProblem FrameProblem::Restricted(const std::vector<int>& joint_index,
                                      const std::vector<int>& hinges) const {
  FrameProblem restricted;
  restricted.reprojection = reprojection.Restricted(joint_index);
  restricted.bone_vectors = bone_vectors.Restricted(joint_index);
  restricted.standing = standing.Restricted(joint_index);
  restricted.rest_prior = rest_prior.Restricted(hinges);
  return restricted;
}

namespace {

// J^T J (its lower half) and J^T r of kRows rows that depend on few dofs.
template <int kRows>
void AddRows(const FrameScratch& scratch, int first_row, std::span<const int> dofs,
             Eigen::MatrixXd* hessian, Eigen::VectorXd* gradient) {
  const Eigen::Map<const Eigen::Matrix<double, kRows, 1>> residuals(scratch.residuals.data() +
                                                                    first_row);
  const auto column = [&](int n) {
    return Eigen::Map<const Eigen::Matrix<double, kRows, 1>>(&scratch.jacobian(first_row, n));
  };
  for (size_t j = 0; j < dofs.size(); ++j) {
    const Eigen::Matrix<double, kRows, 1> a = column(dofs[j]);
    double* const sums = hessian->col(dofs[j]).data();
    (*gradient)[dofs[j]] += a.dot(residuals);
    for (size_t i = j; i < dofs.size(); ++i) sums[dofs[i]] += a.dot(column(dofs[i]));
  }
}

void AddNormalEquations(const FrameProblem& problem, const PosePoint& at, FrameScratch* scratch,
                        Eigen::MatrixXd* hessian, Eigen::VectorXd* gradient) {
  const int num_dofs = static_cast<int>(at.pose.size());
  hessian->setZero(num_dofs, num_dofs);
  gradient->setZero(num_dofs);
  int row = 0;
  for (const Observation2d& point : problem.reprojection.observations()) {
    AddRows<2>(*scratch, row, at.joint_dofs[point.joint], hessian, gradient);
    row += 2;
  }
  std::vector<int>& dofs = scratch->dofs;
  dofs.resize(num_dofs);
  std::iota(dofs.begin(), dofs.end(), 0);
  for (int i = 0; i < problem.joint_positions.num_residuals(); i += 3, row += 3) {
    AddRows<3>(*scratch, row, dofs, hessian, gradient);
  }
  for (const BoneObservation& bone : problem.bone_vectors.bones()) {
    // The root's translation moves both ends alike.
    const std::span<const int> a = std::span(at.joint_dofs[bone.a]).subspan(at.fixed_root ? 0 : 3);
    const std::span<const int> b = std::span(at.joint_dofs[bone.b]).subspan(at.fixed_root ? 0 : 3);
    dofs.clear();
    std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(dofs));
    AddRows<3>(*scratch, row, dofs, hessian, gradient);
    row += 3;
  }
  for (const StandingJoint& joint : problem.standing.joints()) {
    AddRows<1>(*scratch, row, at.joint_dofs[joint.joint], hessian, gradient);
    ++row;
  }
  // A prior's row is about one dof, or about the three of the root's rotation.
  const auto add_diagonal = [&](int first_dof, int count) {
    for (int i = 0; i < count; ++i, ++row) {
      const double derivative = scratch->jacobian(row, first_dof + i);
      (*hessian)(first_dof + i, first_dof + i) += derivative * derivative;
      (*gradient)[first_dof + i] += derivative * scratch->residuals[row];
    }
  };
  add_diagonal(6, problem.rest_prior.num_residuals());
  if (problem.track_prior.num_residuals() > 0) {
    add_diagonal(0, 3);
    AddRows<3>(*scratch, row, std::array{3, 4, 5}, hessian, gradient);
    row += 3;
    add_diagonal(6, num_dofs - 6);
  }
  hessian->triangularView<Eigen::StrictlyUpper>() = hessian->transpose();
}

}  // namespace

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
      !add(problem.standing) || !add(problem.rest_prior) || !add(problem.track_prior)) {
    return std::numeric_limits<double>::infinity();
  }
  if (hessian != nullptr) AddNormalEquations(problem, at, scratch, hessian, gradient);
  return scratch->residuals.squaredNorm();
}

}  // namespace mpc
