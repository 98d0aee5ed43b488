#include "coarse_motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

namespace mpc {
namespace {

constexpr size_t kPatchNodes = 40;
constexpr double kDamping = 1e-6;  // of the diagonal

}  // namespace

CoarseMotion::CoarseMotion(const SurfaceProblem& problem)
    : problem_(problem), patch_(problem.num_nodes, -1) {
  std::vector<std::vector<int>> neighbors(problem.num_nodes);
  for (int e = 0; e < problem.arap.num_blocks(); ++e) {
    neighbors[problem.arap.nodes(e)[0]].push_back(problem.arap.nodes(e)[1]);
  }
  // Patches grow ring by ring.
  for (int seed = 0; seed < problem.num_nodes; ++seed) {
    if (patch_[seed] >= 0) continue;
    std::vector<int> members = {seed};
    patch_[seed] = num_patches_;
    for (size_t m = 0; m < members.size() && members.size() < kPatchNodes; ++m) {
      for (const int j : neighbors[members[m]]) {
        if (patch_[j] >= 0) continue;
        patch_[j] = num_patches_;
        members.push_back(j);
      }
    }
    ++num_patches_;
  }
  for (int e = 0; e < problem.arap.num_blocks(); ++e) {
    const std::span<const int> nodes = problem.arap.nodes(e);
    if (patch_[nodes[0]] != patch_[nodes[1]]) crossing_.push_back(e);
  }
}

template <typename Energy>
void CoarseMotion::Add(const Energy& energy, const WarpField& at, int block) {
  Eigen::Vector3d r;
  BlockJacobian jacobian;
  energy.Evaluate(at, block, r.data(), &jacobian);
  // By the motions of the patches: t_i = T + Omega x lever_i.
  const std::span<const int> nodes = energy.nodes(block);
  std::array<int, kMaxBlockNodes> patches;
  int count = 0;
  for (size_t k = 0; k < nodes.size(); ++k) {
    const int patch = patch_[nodes[k]];
    for (int row = 0; row < energy.rows(); ++row) {
      jacobian.block<1, 3>(row, 6 * k) +=
          levers_.col(nodes[k]).cross(jacobian.block<1, 3>(row, 6 * k + 3).transpose()).transpose();
    }
    const auto end = patches.begin() + count;
    const auto found = std::find(patches.begin(), end, patch);
    const int place = static_cast<int>(found - patches.begin());
    if (found == end) {
      patches[count++] = patch;
      jacobian.middleCols<6>(6 * place) = jacobian.middleCols<6>(6 * k).eval();
    } else {
      jacobian.middleCols<6>(6 * place) += jacobian.middleCols<6>(6 * k);
    }
  }
  for (int a = 0; a < count; ++a) {
    for (int b = 0; b < count; ++b) {
      normal_.block<6, 6>(6 * patches[a], 6 * patches[b]) +=
          jacobian.middleCols<6>(6 * a).transpose().lazyProduct(jacobian.middleCols<6>(6 * b));
    }
  }
}

void CoarseMotion::Linearize(const WarpField& at) {
  Eigen::Matrix3Xd middle = Eigen::Matrix3Xd::Zero(3, num_patches_);
  Eigen::VectorXd size = Eigen::VectorXd::Zero(num_patches_);
  for (int i = 0; i < problem_.num_nodes; ++i) {
    middle.col(patch_[i]) += problem_.nodes.col(i) + at.translations.col(i);
    ++size[patch_[i]];
  }
  levers_ = problem_.nodes + at.translations;
  for (int i = 0; i < problem_.num_nodes; ++i) {
    levers_.col(i) -= middle.col(patch_[i]) / size[patch_[i]];
  }
  float_levers_ = levers_.cast<float>();
  normal_.setZero(6 * num_patches_, 6 * num_patches_);
  for (int row = 0; row < problem_.contour.num_blocks(); ++row) Add(problem_.contour, at, row);
  for (const int e : crossing_) Add(problem_.arap, at, e);
  for (int i = 0; i < problem_.depth_drift.num_blocks(); ++i) Add(problem_.depth_drift, at, i);
  normal_.diagonal() *= 1 + kDamping;
  normal_.diagonal().array() += kDamping * kDamping * normal_.diagonal().maxCoeff();
  factor_.compute(normal_.cast<float>());
}

void CoarseMotion::Apply(const Eigen::Matrix<float, 4, Eigen::Dynamic>& x,
                         Eigen::Matrix<float, 4, Eigen::Dynamic>* product) {
  if (factor_.info() != Eigen::Success) return;
  motion_.setZero(6 * num_patches_);
  for (int i = 0; i < problem_.num_nodes; ++i) {
    const Eigen::Vector3f lever = float_levers_.col(i), t = x.col(2 * i + 1).head<3>();
    motion_.segment<3>(6 * patch_[i]) += x.col(2 * i).head<3>() + lever.cross(t);
    motion_.segment<3>(6 * patch_[i] + 3) += t;
  }
  factor_.solveInPlace(motion_);
  for (int i = 0; i < problem_.num_nodes; ++i) {
    const Eigen::Vector3f lever = float_levers_.col(i);
    const Eigen::Vector3f omega = motion_.segment<3>(6 * patch_[i]);
    product->col(2 * i).head<3>() += omega;
    product->col(2 * i + 1).head<3>() += motion_.segment<3>(6 * patch_[i] + 3) + omega.cross(lever);
  }
}

}  // namespace mpc
