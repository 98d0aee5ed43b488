#include "coarse_motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

#include "mpc/core/rigid.h"

namespace mpc {
namespace {

constexpr size_t kPatchNodes = 40;
constexpr double kDamping = 1e-6;  // of the diagonal

using Block = Eigen::Matrix<double, 6, 6>;

}  // namespace

CoarseMotion::CoarseMotion(const SurfaceProblem& problem, std::span<const int> edge_begin,
                           std::span<const int> edge_node)
    : problem_(problem), patch_(problem.num_nodes, -1) {
  // Patches grow ring by ring.
  std::vector<int> members;
  for (int seed = 0; seed < problem.num_nodes; ++seed) {
    if (patch_[seed] >= 0) continue;
    members = {seed};
    patch_[seed] = num_patches_;
    for (size_t m = 0; m < members.size() && members.size() < kPatchNodes; ++m) {
      for (int e = edge_begin[members[m]]; e < edge_begin[members[m] + 1]; ++e) {
        const int j = edge_node[e];
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

void CoarseMotion::Add(int a, int b, const Block& block) {
  if (a >= b) {
    normal_.block<6, 6>(6 * a, 6 * b) += block;
  } else {
    normal_.block<6, 6>(6 * b, 6 * a) += block.transpose();
  }
}

// Rows of a residual, by the motions of the patches: t_i = T + Omega x lever_i.
template <typename Energy>
void CoarseMotion::AddBlock(const Energy& energy, const WarpField& at, int block) {
  Eigen::Vector3d r;
  BlockJacobian jacobian;
  energy.Evaluate(at, block, r.data(), &jacobian);
  const std::span<const int> nodes = energy.nodes(block);
  std::array<int, kMaxBlockNodes> patches;
  using ByMotion = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 3>;
  std::array<ByMotion, kMaxBlockNodes> by_patch;
  int count = 0;
  for (size_t k = 0; k < nodes.size(); ++k) {
    ByMotion by_motion = jacobian.middleCols<6>(6 * k).transpose();
    by_motion.topRows<3>() += CrossMatrix(levers_.col(nodes[k])) * by_motion.bottomRows<3>();
    const auto end = patches.begin() + count;
    const auto found = std::find(patches.begin(), end, patch_[nodes[k]]);
    if (found == end) {
      patches[count] = patch_[nodes[k]];
      by_patch[count++] = by_motion;
    } else {
      by_patch[found - patches.begin()] += by_motion;
    }
  }
  for (int a = 0; a < count; ++a) {
    for (int b = 0; b <= a; ++b) Add(patches[a], patches[b], by_patch[a] * by_patch[b].transpose());
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
  packed_levers_.setZero(4, problem_.num_nodes);
  packed_levers_.topRows<3>() = levers_.cast<float>();
  normal_.setZero(6 * num_patches_, 6 * num_patches_);
  for (int row = 0; row < problem_.contour.num_blocks(); ++row) AddBlock(problem_.contour, at, row);
  for (const int e : crossing_) AddBlock(problem_.arap, at, e);
  for (int i = 0; i < problem_.drift.num_blocks(); ++i) AddBlock(problem_.drift, at, i);
  normal_.diagonal() *= 1 + kDamping;
  normal_.diagonal().array() += kDamping * kDamping * normal_.diagonal().maxCoeff();
  factor_.compute(normal_.cast<float>());
}

void CoarseMotion::Apply(const Packed& x, Packed* product) {
  if (factor_.info() != Eigen::Success) return;
  const Float4* in = Columns(x);
  const Float4* levers = Columns(packed_levers_);
  Float4* out = Columns(product);
  motion_.setZero(4, 2 * num_patches_);
  Float4* motion = Columns(&motion_);
  for (int i = 0; i < problem_.num_nodes; ++i) {
    motion[2 * patch_[i]] += in[2 * i] + Cross(levers[i], in[2 * i + 1]);
    motion[2 * patch_[i] + 1] += in[2 * i + 1];
  }
  answer_ = motion_.topRows<3>().reshaped();
  factor_.solveInPlace(answer_);
  motion_.topRows<3>().reshaped() = answer_;
  for (int i = 0; i < problem_.num_nodes; ++i) {
    const Float4 omega = motion[2 * patch_[i]];
    out[2 * i] += omega;
    out[2 * i + 1] += motion[2 * patch_[i] + 1] + Cross(omega, levers[i]);
  }
}

}  // namespace mpc
