#include "mpc/skeleton/skinning_jacobian.h"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"

namespace mpc {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

// Adds weight times a motion to a blend.
void Add(double weight, const DualQuaterniond& motion, DualQuaterniond* blend) {
  blend->real.coeffs() += weight * motion.real.coeffs();
  blend->dual.coeffs() += weight * motion.dual.coeffs();
}

DualQuaterniond SegmentMotion(const KinematicState& bind, const KinematicState& state, int s) {
  const Matrix3d rotation = state.rotations[s] * bind.rotations[s].transpose();
  const Vector3d half = (state.origins.col(s) - rotation * bind.origins.col(s)) / 2;
  DualQuaterniond motion;
  motion.real = Quaterniond(rotation);
  motion.dual = Quaterniond(0, half.x(), half.y(), half.z()) * motion.real;
  return motion;
}

// d x' / d blend for x' = x + 2 n / |r|^2 with n = r x (r x x + w x) + w d - dw r + r x d, where
// (w, r) and (dw, d) are the blend's real and dual parts. Columns: w, r, dw, d.
Eigen::Matrix<double, 3, 8> BlendDerivative(const DualQuaterniond& blend, const Vector3d& x,
                                            Vector3d* moved) {
  const double w = blend.real.w();
  const Vector3d r = blend.real.vec();
  const Vector3d d = blend.dual.vec();
  const Vector3d inner = r.cross(x) + w * x + d;
  const Vector3d n = r.cross(inner) + w * d - blend.dual.w() * r;
  const double scale = 2 / blend.real.squaredNorm();
  *moved = x + scale * n;

  Eigen::Matrix<double, 3, 8> derivative;
  derivative.col(0) = r.cross(x) + d;
  derivative.middleCols<3>(1) =
      -CrossMatrix(inner) - CrossMatrix(r) * CrossMatrix(x) - blend.dual.w() * Matrix3d::Identity();
  derivative.col(4) = -r;
  derivative.rightCols<3>() = w * Matrix3d::Identity() + CrossMatrix(r);
  derivative *= scale;
  derivative.col(0) -= scale * scale * w * n;
  derivative.middleCols<3>(1) -= scale * scale * n * r.transpose();
  return derivative;
}

// x' of BlendDerivative alone.
Vector3d MovedPoint(const DualQuaterniond& blend, const Vector3d& x) {
  const double w = blend.real.w();
  const Vector3d r = blend.real.vec();
  const Vector3d d = blend.dual.vec();
  const Vector3d n = r.cross(r.cross(x) + w * x + d) + w * d - blend.dual.w() * r;
  return x + 2 / blend.real.squaredNorm() * n;
}

// Its derivative's transpose times a direction.
Eigen::Matrix<double, 8, 1> BlendGradient(const DualQuaterniond& blend, const Vector3d& x,
                                          const Vector3d& direction) {
  const double w = blend.real.w();
  const Vector3d r = blend.real.vec();
  const Vector3d d = blend.dual.vec();
  const Vector3d turned = r.cross(x) + d;
  const Vector3d inner = turned + w * x;
  const Vector3d n = r.cross(inner) + w * d - blend.dual.w() * r;
  const double scale = 2 / blend.real.squaredNorm();
  const Vector3d scaled = scale * direction;
  const Vector3d crossed = r.cross(scaled);
  const double along = scale * n.dot(scaled);
  Eigen::Matrix<double, 8, 1> gradient;
  gradient[0] = turned.dot(scaled) - along * w;
  gradient.segment<3>(1) =
      inner.cross(scaled) - x.cross(crossed) - blend.dual.w() * scaled - along * r;
  gradient[4] = -r.dot(scaled);
  gradient.tail<3>() = w * scaled - crossed;
  return gradient;
}

// Derivative of a product twist * q / 2 with respect to the twist, a pure quaternion: 4x3, rows w,
// x, y, z.
Eigen::Matrix<double, 4, 3> HalfRightFactor(const Quaterniond& q) {
  Eigen::Matrix<double, 4, 3> factor;
  factor.row(0) = -q.vec().transpose() / 2;
  factor.bottomRows<3>() = (q.w() * Matrix3d::Identity() - CrossMatrix(q.vec())) / 2;
  return factor;
}

}  // namespace

Vector3d SkinnedVertex(const Character& character, const KinematicState& state, int vertex,
                       Eigen::Matrix3Xd* jacobian) {
  if (vertex < 0 || vertex >= character.mesh.positions.cols()) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("vertex {} of a mesh with {} vertices",
                                                         vertex, character.mesh.positions.cols()));
  }
  const Skeleton& skeleton = character.skeleton;
  const Vector3d x = character.mesh.positions.col(vertex).cast<double>();
  const Eigen::Index num_influences = character.segments.rows();
  // Motion and signed weight of an influence; antipodality against the first one.
  const DualQuaterniond pivot = SegmentMotion(character.bind, state, character.segments(0, vertex));
  const auto influence = [&](Eigen::Index k, double* weight) {
    const DualQuaterniond motion =
        k == 0 ? pivot : SegmentMotion(character.bind, state, character.segments(k, vertex));
    *weight = character.weights(k, vertex);
    if (motion.real.dot(pivot.real) < 0) *weight = -*weight;
    return motion;
  };
  DualQuaterniond blend;
  for (Eigen::Index k = 0; k < num_influences; ++k) {
    double weight;
    const DualQuaterniond motion = influence(k, &weight);
    Add(weight, motion, &blend);
  }
  Vector3d moved;
  const Eigen::Matrix<double, 3, 8> from_blend = BlendDerivative(blend, x, &moved);
  if (jacobian == nullptr) return moved;

  jacobian->setZero(3, skeleton.num_dofs());
  jacobian->leftCols<3>().setIdentity();
  const Vector3d from_root = moved - state.origins.col(0);
  for (int axis = 0; axis < 3; ++axis) {
    jacobian->col(3 + axis) = Vector3d::Unit(axis).cross(from_root);
  }
  // A hinge moves the segments beyond it by the twist (axis, origin x axis), and a motion's rate of
  // change is half the twist times the motion.
  for (Eigen::Index k = 0; k < num_influences; ++k) {
    double weight;
    const DualQuaterniond motion = influence(k, &weight);
    if (weight == 0) continue;
    const Eigen::Matrix<double, 4, 3> real = HalfRightFactor(motion.real);
    const Eigen::Matrix<double, 4, 3> dual = HalfRightFactor(motion.dual);
    const Matrix3d from_linear = weight * from_blend.rightCols<4>() * real;
    const Matrix3d from_angular =
        weight * (from_blend.leftCols<4>() * real + from_blend.rightCols<4>() * dual);
    for (int s = character.segments(k, vertex); s > 0; s = skeleton.segments[s].parent) {
      const Vector3d origin = state.origins.col(s);
      for (int h = state.hinge_begin[s]; h < state.hinge_begin[s + 1]; ++h) {
        const Vector3d axis = state.hinge_axes.col(h);
        jacobian->col(6 + h) += from_angular * axis + from_linear * origin.cross(axis);
      }
    }
  }
  return moved;
}

void VertexSkinner::Update(const KinematicState& state) {
  const int num_segments = character_->skeleton.num_segments();
  motions_.resize(static_cast<size_t>(num_segments));
  for (int s = 0; s < num_segments; ++s) {
    Motion& motion = motions_[static_cast<size_t>(s)];
    motion.motion = SegmentMotion(character_->bind, state, s);
    motion.real_factor = HalfRightFactor(motion.motion.real);
    motion.dual_factor = HalfRightFactor(motion.motion.dual);
  }
  root_ = state.origins.col(0);
  hinge_begin_ = state.hinge_begin;
  hinge_twists_.resize(6, state.hinge_axes.cols());
  hinge_twists_.topRows<3>() = state.hinge_axes;
  for (int s = 1; s < num_segments; ++s) {
    const Vector3d origin = state.origins.col(s);
    for (int h = hinge_begin_[s]; h < hinge_begin_[s + 1]; ++h) {
      hinge_twists_.col(h).tail<3>() = origin.cross(Vector3d(state.hinge_axes.col(h)));
    }
  }
}

DualQuaterniond VertexSkinner::Blend(int vertex) const {
  const DualQuaterniond& pivot = motions_[character_->segments(0, vertex)].motion;
  DualQuaterniond blend;
  for (Eigen::Index k = 0; k < character_->segments.rows(); ++k) {
    const double weight = character_->weights(k, vertex);
    if (weight == 0) continue;
    const DualQuaterniond& motion = motions_[character_->segments(k, vertex)].motion;
    Add(motion.real.dot(pivot.real) < 0 ? -weight : weight, motion, &blend);
  }
  return blend;
}

Vector3d VertexSkinner::Position(int vertex) const {
  return MovedPoint(Blend(vertex), character_->mesh.positions.col(vertex).cast<double>());
}

void VertexSkinner::Derivative(int vertex, const Vector3d& direction,
                               Eigen::Ref<Eigen::VectorXd> row) const {
  const Skeleton& skeleton = character_->skeleton;
  const Vector3d x = character_->mesh.positions.col(vertex).cast<double>();
  const DualQuaterniond blend = Blend(vertex);
  const Eigen::Matrix<double, 8, 1> from_blend = BlendGradient(blend, x, direction);
  row.head<3>() = direction;
  row.segment<3>(3) = (MovedPoint(blend, x) - root_).cross(direction);

  twists_.setZero(6, skeleton.num_segments());
  const Quaterniond& pivot = motions_[character_->segments(0, vertex)].motion.real;
  for (Eigen::Index k = 0; k < character_->segments.rows(); ++k) {
    double weight = character_->weights(k, vertex);
    if (weight == 0) continue;
    const int s = character_->segments(k, vertex);
    const Motion& m = motions_[s];
    if (m.motion.real.dot(pivot) < 0) weight = -weight;
    twists_.col(s).head<3>() += weight * (m.real_factor.transpose() * from_blend.head<4>() +
                                          m.dual_factor.transpose() * from_blend.tail<4>());
    twists_.col(s).tail<3>() += weight * (m.real_factor.transpose() * from_blend.tail<4>());
  }
  // A hinge twists all segments beyond it.
  for (int s = skeleton.num_segments() - 1; s > 0; --s) {
    for (int h = hinge_begin_[s]; h < hinge_begin_[s + 1]; ++h) {
      row[6 + h] = twists_.col(s).dot(hinge_twists_.col(h));
    }
    twists_.col(skeleton.segments[s].parent) += twists_.col(s);
  }
}

}  // namespace mpc
