#include "surface_step.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <limits>

#include "mpc/core/rigid.h"

namespace mpc {
namespace {

constexpr int kMaxInnerIterations = 40;
constexpr float kInnerTolerance = 5e-2f;  // of the length of the residual

// Four floats of which the last is zero, as the compilers know them for any processor: Eigen's
// cross3 of such vectors is not SIMD everywhere.
using Float4 = float __attribute__((vector_size(16), may_alias));

Float4 Cross(Float4 a, Float4 b) {
  const Float4 a_next = __builtin_shufflevector(a, a, 1, 2, 0, 3);
  const Float4 b_next = __builtin_shufflevector(b, b, 1, 2, 0, 3);
  const Float4 turned = a * b_next - a_next * b;
  return __builtin_shufflevector(turned, turned, 1, 2, 0, 3);
}

const Float4* Columns(const Eigen::Matrix<float, 4, Eigen::Dynamic>& x) {
  return reinterpret_cast<const Float4*>(x.data());
}
Float4* Columns(Eigen::Matrix<float, 4, Eigen::Dynamic>* x) {
  return reinterpret_cast<Float4*>(x->data());
}

Eigen::Matrix3d Cross(const Eigen::Vector3d& x) {
  Eigen::Matrix3d cross;
  cross << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
  return cross;
}

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
  Eigen::Vector4f padded = Eigen::Vector4f::Zero();
  padded.head<3>() = x.cast<float>();
  return padded;
}

}  // namespace

SurfaceStep::SurfaceStep(const SurfaceProblem& problem)
    : problem_(problem), coarse_(problem), edge_begin_(problem.num_nodes + 1, 0), row_begin_(1, 0) {
  for (int e = 0; e < problem.arap.num_blocks(); ++e) {
    ++edge_begin_[problem.arap.nodes(e)[0] + 1];
    edge_node_.push_back(problem.arap.nodes(e)[1]);
  }
  for (int i = 0; i < problem.num_nodes; ++i) edge_begin_[i + 1] += edge_begin_[i];
  for (int row = 0; row < problem.contour.num_blocks(); ++row) {
    row_begin_.push_back(row_begin_.back() + static_cast<int>(problem.contour.nodes(row).size()));
  }
}

bool SurfaceStep::Linearize(const WarpField& at) {
  gradient_.setZero(6, problem_.num_nodes);
  diagonal_.assign(problem_.num_nodes, Block::Zero());
  AddArap(at);
  AddDepthDrift(at);
  smooth_diagonal_ = diagonal_;
  if (!AddContour(at)) return false;
  // It only guides the search, so that the first point's will do for all.
  if (!coarse_.ready()) coarse_.Linearize(at);
  return true;
}

// With y = scale R_i (g^_i - g^_j), the Jacobian of an edge's residual by (omega_i, t_i, t_j) is
// ([y]x, scale, -scale).
void SurfaceStep::AddArap(const WarpField& at) {
  const double scale = problem_.arap.scale();
  edge_levers_.resize(4, 2 * problem_.arap.num_blocks());
  for (int i = 0; i < problem_.num_nodes; ++i) {
    Block& own = diagonal_[i];
    for (int e = edge_begin_[i]; e < edge_begin_[i + 1]; ++e) {
      const int j = problem_.arap.nodes(e)[1];
      const Eigen::Vector3d y = scale * problem_.arap.Lever(at, e);
      const Eigen::Vector3d y_back = -scale * (at.rotations[j] * problem_.arap.rest(e));
      const Eigen::Vector3d r =
          scale * (problem_.arap.rest(e) + at.translations.col(i) - at.translations.col(j)) - y;
      gradient_.col(i).head<3>() += r.cross(y);
      gradient_.col(i).tail<3>() += scale * r;
      gradient_.col(j).tail<3>() -= scale * r;
      own.topLeftCorner<3, 3>() -= y * y.transpose();
      own.topLeftCorner<3, 3>().diagonal().array() += y.squaredNorm();
      own.topRightCorner<3, 3>() -= scale * Cross(y);
      own.bottomRightCorner<3, 3>().diagonal().array() += 2 * scale * scale;
      edge_levers_.col(2 * e) = Pad(scale * y);
      edge_levers_.col(2 * e + 1) = Pad(scale * y_back);
    }
    own.bottomLeftCorner<3, 3>() = own.topRightCorner<3, 3>().transpose();
  }
}

void SurfaceStep::AddDepthDrift(const WarpField& at) {
  BlockJacobian jacobian;
  double r = 0;
  for (int i = 0; i < problem_.depth_drift.num_blocks(); ++i) {
    problem_.depth_drift.Evaluate(at, i, &r, &jacobian);
    const Vector6 j = jacobian.block<1, 6>(0, 0).transpose();
    gradient_.col(i) += r * j;
    diagonal_[i] += j * j.transpose();
  }
}

bool SurfaceStep::AddContour(const WarpField& at) {
  BlockJacobian jacobian;
  double r = 0;
  row_blocks_.resize(4, 2 * row_begin_.back());
  for (int row = 0; row < problem_.contour.num_blocks(); ++row) {
    if (!problem_.contour.Evaluate(at, row, &r, &jacobian)) return false;
    const std::span<const int> nodes = problem_.contour.nodes(row);
    for (size_t k = 0; k < nodes.size(); ++k) {
      const Vector6 j = jacobian.block<1, 6>(0, 6 * k).transpose();
      gradient_.col(nodes[k]) += r * j;
      diagonal_[nodes[k]] += j * j.transpose();
      row_blocks_.col(2 * (row_begin_[row] + k)) = Pad(j.head<3>());
      row_blocks_.col(2 * (row_begin_[row] + k) + 1) = Pad(j.tail<3>());
    }
  }
  return true;
}

// Damped blocks for Multiply, and the inverses for Precondition.
void SurfaceStep::Damp(double damping) {
  own_blocks_.resize(4, 7 * problem_.num_nodes);
  inverses_.setZero(4, 12 * problem_.num_nodes);
  for (int i = 0; i < problem_.num_nodes; ++i) {
    Vector6 damp;
    damp.head<3>().setConstant(diagonal_[i].topLeftCorner<3, 3>().trace());
    damp.tail<3>().setConstant(diagonal_[i].bottomRightCorner<3, 3>().trace());
    damp = damping / 3 * damp.array() + std::numeric_limits<float>::min();
    const Block smooth = smooth_diagonal_[i] + Block(damp.asDiagonal());
    for (int c = 0; c < 3; ++c) {
      own_blocks_.col(7 * i + c) = Pad(smooth.block<3, 1>(0, c));
      own_blocks_.col(7 * i + 3 + c) = Pad(smooth.block<3, 1>(3, 3 + c));
    }
    // [Z]x stands in the lower left corner.
    own_blocks_.col(7 * i + 6) = Pad({smooth(5, 1), smooth(3, 2), smooth(4, 0)});
    const Block inverse = Inverse(diagonal_[i] + Block(damp.asDiagonal()));
    for (int c = 0; c < 6; ++c) {
      inverses_.col(12 * i + 2 * c) = Pad(inverse.block<3, 1>(0, c));
      inverses_.col(12 * i + 2 * c + 1) = Pad(inverse.block<3, 1>(3, c));
    }
  }
}

void SurfaceStep::Multiply(const Packed& x, Packed* product) const {
  const Float4* in = Columns(x);
  const Float4* levers = Columns(edge_levers_);
  Float4* out = Columns(product);
  const auto twice_square = static_cast<float>(2 * problem_.arap.scale() * problem_.arap.scale());
  for (int i = 0; i < problem_.num_nodes; ++i) {
    const Float4 omega = in[2 * i], t = in[2 * i + 1];
    const Float4* own = Columns(own_blocks_) + 7 * i;
    Float4 by_omega = Cross(t, own[6]), by_t = Cross(own[6], omega), sum_t = {};
    for (int c = 0; c < 3; ++c) {
      by_omega += omega[c] * own[c];
      by_t += t[c] * own[3 + c];
    }
    for (int e = edge_begin_[i]; e < edge_begin_[i + 1]; ++e) {
      const int j = edge_node_[e];
      sum_t += in[2 * j + 1];
      by_omega -= Cross(in[2 * j + 1], levers[2 * e]);
      by_t -= Cross(levers[2 * e + 1], in[2 * j]);
    }
    out[2 * i] = by_omega;
    out[2 * i + 1] = by_t - twice_square * sum_t;
  }
  const Float4* rows = Columns(row_blocks_);
  for (int row = 0; row < problem_.contour.num_blocks(); ++row) {
    const std::span<const int> nodes = problem_.contour.nodes(row);
    const Float4* block = rows + 2 * row_begin_[row];
    Float4 change = {};
    for (size_t k = 0; k < nodes.size(); ++k) {
      change += block[2 * k] * in[2 * nodes[k]] + block[2 * k + 1] * in[2 * nodes[k] + 1];
    }
    const float sum = change[0] + change[1] + change[2];
    for (size_t k = 0; k < nodes.size(); ++k) {
      out[2 * nodes[k]] += sum * block[2 * k];
      out[2 * nodes[k] + 1] += sum * block[2 * k + 1];
    }
  }
}

void SurfaceStep::Precondition(const Packed& x, Packed* product) {
  for (int i = 0; i < problem_.num_nodes; ++i) {
    Eigen::Vector4f omega = Eigen::Vector4f::Zero(), t = omega;
    for (int c = 0; c < 6; ++c) {
      const float entry = x(c % 3, 2 * i + c / 3);
      omega += entry * inverses_.col(12 * i + 2 * c);
      t += entry * inverses_.col(12 * i + 2 * c + 1);
    }
    product->col(2 * i) = omega;
    product->col(2 * i + 1) = t;
  }
  coarse_.Apply(x, product);
}

void SurfaceStep::SolveInner() {
  const auto dot = [](const Packed& a, const Packed& b) { return a.cwiseProduct(b).sum(); };
  step_.setZero(4, 2 * problem_.num_nodes);
  residual_.setZero(4, 2 * problem_.num_nodes);
  for (int i = 0; i < problem_.num_nodes; ++i) {
    residual_.col(2 * i) = Pad(-gradient_.col(i).head<3>());
    residual_.col(2 * i + 1) = Pad(-gradient_.col(i).tail<3>());
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
