#include "surface_step.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <limits>

#include "mpc/core/rigid.h"

namespace mpc {
namespace {

constexpr int kMaxInnerIterations = 40;
constexpr float kInnerTolerance = 5e-2f;  // of the length of the residual

// Of a symmetric positive definite matrix, by its 3x3 blocks: no loops, no calls.
Eigen::Matrix<double, 6, 6> Inverse(const Eigen::Matrix<double, 6, 6>& x) {
  const Eigen::Matrix3d a = x.topLeftCorner<3, 3>().inverse();
  const Eigen::Matrix3d b = a * x.topRightCorner<3, 3>();
  const Eigen::Matrix3d d =
      (x.bottomRightCorner<3, 3>() - x.bottomLeftCorner<3, 3>() * b).inverse();
  Eigen::Matrix<double, 6, 6> inverse;
  inverse.topRightCorner<3, 3>() = -b * d;
  inverse.bottomLeftCorner<3, 3>() = inverse.topRightCorner<3, 3>().transpose();
  inverse.topLeftCorner<3, 3>() = a + b * d * b.transpose();
  inverse.bottomRightCorner<3, 3>() = d;
  return inverse;
}

Eigen::Vector4f Pad(const Eigen::Vector3d& x) {
  return {static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2]), 0};
}

}  // namespace

SurfaceStep::SurfaceStep(const SurfaceProblem& problem)
    : problem_(problem), edge_begin_(problem.num_nodes + 1, 0), row_begin_(1, 0) {
  for (int e = 0; e < problem.arap.num_blocks(); ++e) {
    ++edge_begin_[problem.arap.nodes(e)[0] + 1];
    edge_node_.push_back(problem.arap.nodes(e)[1]);
  }
  for (int i = 0; i < problem.num_nodes; ++i) edge_begin_[i + 1] += edge_begin_[i];
  for (int i = 0; i < problem.num_nodes; ++i) {
    for (int e = edge_begin_[i]; e < edge_begin_[i + 1]; ++e) {
      const auto neighbors = edge_node_.begin() + edge_begin_[edge_node_[e]];
      edge_back_.push_back(
          static_cast<int>(std::find(neighbors, edge_node_.end(), i) - edge_node_.begin()));
    }
  }
  for (int row = 0; row < problem.contour.num_blocks(); ++row) {
    const std::span<const int> nodes = problem.contour.nodes(row);
    row_node_.insert(row_node_.end(), nodes.begin(), nodes.end());
    row_begin_.push_back(static_cast<int>(row_node_.size()));
  }
  coarse_.emplace(problem, edge_begin_, edge_node_);

  const int num_edges = problem.arap.num_blocks();
  rest_.setZero(4, num_edges);
  for (int e = 0; e < num_edges; ++e) rest_.col(e).head<3>() = problem.arap.rest(e);
  turns_.setZero(4, 3 * problem.num_nodes);
  shifts_.setZero(4, problem.num_nodes);
  gradient_.resize(8, problem.num_nodes);
  edge_levers_.resize(4, 2 * num_edges);
  smooth_.resize(4, 8 * problem.num_nodes);
}

bool SurfaceStep::Linearize(const WarpField& at) {
  // What only guides the search is that of the first point.
  const bool is_first = diagonal_.empty();
  if (is_first) diagonal_.assign(problem_.num_nodes, Block::Zero());
  gradient_.setZero();
  AddArap(at);
  AddDrift(at);
  if (is_first) {
    for (int i = 0; i < problem_.num_nodes; ++i) diagonal_[i] += SmoothBlock(i);
  }
  if (!AddContour(at, is_first)) return false;
  if (is_first) coarse_->Linearize(at);
  return true;
}

void SurfaceStep::AddArap(const WarpField& at) {
  for (int i = 0; i < problem_.num_nodes; ++i) {
    turns_.block<3, 3>(0, 3 * i) = at.rotations[i];
    shifts_.col(i).head<3>() = at.translations.col(i);
  }
  kernel_.linearize({.num_nodes = problem_.num_nodes,
                     .scale = problem_.arap.scale(),
                     .edge_begin = edge_begin_.data(),
                     .edge_node = edge_node_.data(),
                     .edge_back = edge_back_.data(),
                     .rest = rest_.data(),
                     .turns = turns_.data(),
                     .shifts = shifts_.data()},
                    gradient_.data(), edge_levers_.data(), smooth_.data());
}

void SurfaceStep::AddDrift(const WarpField& at) {
  BlockJacobian jacobian;
  Eigen::Vector3d r;
  for (int i = 0; i < problem_.drift.num_blocks(); ++i) {
    problem_.drift.Evaluate(at, i, r.data(), &jacobian);
    const Eigen::Matrix3d by_translation = jacobian.rightCols<3>();
    gradient_.col(i).segment<3>(4) += by_translation.transpose() * r;
    const Eigen::Matrix3d block = by_translation.transpose() * by_translation;
    for (int c = 0; c < 3; ++c) smooth_.col(8 * i + 2 * c + 1) += Pad(block.col(c));
  }
}

SurfaceStep::Block SurfaceStep::SmoothBlock(int node) const {
  Block block;
  for (int c = 0; c < 3; ++c) {
    block.block<3, 1>(0, c) = smooth_.col(8 * node + 2 * c).head<3>().cast<double>();
    block.block<3, 1>(3, 3 + c) = smooth_.col(8 * node + 2 * c + 1).head<3>().cast<double>();
  }
  block.bottomLeftCorner<3, 3>() = CrossMatrix(smooth_.col(8 * node + 6).head<3>().cast<double>());
  block.topRightCorner<3, 3>() = block.bottomLeftCorner<3, 3>().transpose();
  return block;
}

bool SurfaceStep::AddContour(const WarpField& at, bool to_diagonal) {
  BlockJacobian jacobian;
  double r = 0;
  row_blocks_.resize(4, 2 * row_begin_.back());
  for (int row = 0; row < problem_.contour.num_blocks(); ++row) {
    if (!problem_.contour.Evaluate(at, row, &r, &jacobian)) return false;
    const std::span<const int> nodes = problem_.contour.nodes(row);
    for (size_t k = 0; k < nodes.size(); ++k) {
      const Vector6 j = jacobian.block<1, 6>(0, 6 * k).transpose();
      gradient_.col(nodes[k]).head<3>() += r * j.head<3>();
      gradient_.col(nodes[k]).segment<3>(4) += r * j.tail<3>();
      if (to_diagonal) diagonal_[nodes[k]] += j * j.transpose();
      row_blocks_.col(2 * (row_begin_[row] + k)) = Pad(j.head<3>());
      row_blocks_.col(2 * (row_begin_[row] + k) + 1) = Pad(j.tail<3>());
    }
  }
  return true;
}

// Damped blocks for Multiply, and the inverses for Precondition.
void SurfaceStep::Damp(double damping) {
  // The inverses of a small damping will do for a smaller one.
  const bool invert = inverses_.size() == 0 || damping > inverses_damping_;
  own_blocks_ = smooth_;
  if (invert) {
    inverses_.resize(4, 12 * problem_.num_nodes);
    inverses_damping_ = damping;
  }
  for (int i = 0; i < problem_.num_nodes; ++i) {
    Vector6 damp;
    damp.head<3>().setConstant(diagonal_[i].topLeftCorner<3, 3>().trace());
    damp.tail<3>().setConstant(diagonal_[i].bottomRightCorner<3, 3>().trace());
    damp = damping / 3 * damp.array() + std::numeric_limits<float>::min();
    for (int c = 0; c < 3; ++c) {
      own_blocks_(c, 8 * i + 2 * c) += static_cast<float>(damp[0]);
      own_blocks_(c, 8 * i + 2 * c + 1) += static_cast<float>(damp[3]);
    }
    if (!invert) continue;
    const Block inverse = Inverse(diagonal_[i] + Block(damp.asDiagonal()));
    for (int c = 0; c < 6; ++c) {
      inverses_.col(12 * i + 2 * c) = Pad(inverse.block<3, 1>(0, c));
      inverses_.col(12 * i + 2 * c + 1) = Pad(inverse.block<3, 1>(3, c));
    }
  }
}

void SurfaceStep::Multiply(const Packed& x, Packed* product) const {
  const auto twice_square = static_cast<float>(2 * problem_.arap.scale() * problem_.arap.scale());
  const NormalEquations normal = {.num_nodes = problem_.num_nodes,
                                  .edge_begin = edge_begin_.data(),
                                  .edge_node = edge_node_.data(),
                                  .levers = edge_levers_.data(),
                                  .twice_square = twice_square,
                                  .own = own_blocks_.data(),
                                  .num_rows = problem_.contour.num_blocks(),
                                  .row_begin = row_begin_.data(),
                                  .row_node = row_node_.data(),
                                  .rows = row_blocks_.data()};
  kernel_.multiply(normal, x.data(), product->data());
}

void SurfaceStep::Precondition(const Packed& x, Packed* product) {
  kernel_.multiply_blocks(problem_.num_nodes, inverses_.data(), x.data(), product->data());
  coarse_->Apply(x, product);
}

void SurfaceStep::SolveInner() {
  const auto dot = [](const Packed& a, const Packed& b) { return a.cwiseProduct(b).sum(); };
  step_.setZero(4, 2 * problem_.num_nodes);
  residual_.setZero(4, 2 * problem_.num_nodes);
  for (int i = 0; i < problem_.num_nodes; ++i) {
    residual_.col(2 * i) = Pad(-gradient_.col(i).head<3>());
    residual_.col(2 * i + 1) = Pad(-gradient_.col(i).segment<3>(4));
  }
  product_.resizeLike(step_);
  preconditioned_.resizeLike(step_);
  Precondition(residual_, &preconditioned_);
  direction_ = preconditioned_;
  float length = dot(residual_, preconditioned_);
  const float goal = kInnerTolerance * kInnerTolerance * length;
  for (int k = 0; k < kMaxInnerIterations && length > goal; ++k) {
    Multiply(direction_, &product_);
    const float curvature = dot(direction_, product_);
    if (!(curvature > 0)) break;
    const float along = length / curvature;
    step_ += along * direction_;
    residual_ -= along * product_;
    Precondition(residual_, &preconditioned_);
    const float next_length = dot(residual_, preconditioned_);
    direction_ = preconditioned_ + next_length / length * direction_;
    length = next_length;
  }
}

WarpField SurfaceStep::Step(const WarpField& from, double damping) {
  Damp(damping);
  SolveInner();
  WarpField to = from;
  for (int i = 0; i < problem_.num_nodes; ++i) {
    to.rotations[i] = ExpSO3(step_.col(2 * i).head<3>().cast<double>()) * from.rotations[i];
    to.translations.col(i) += step_.col(2 * i + 1).head<3>().cast<double>();
  }
  return to;
}

}  // namespace mpc
