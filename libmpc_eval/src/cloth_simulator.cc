#include "cloth_simulator.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr double kGravity = 9.81;
constexpr double kAirDragPerS = 0.9;   // of cloth that hangs free
constexpr double kLayerDragPerS = 12;  // of cloth that lies on the body, against the body
// Cloth does not creep: what moves against the body loses this speed per second, m/s^2.
constexpr double kInnerFriction = 0.3;
constexpr int kStretchIterations = 3;
constexpr double kStretchCompliance = 2e-9;  // of unit masses, s^2
constexpr double kBendCompliance = 4e-4;
constexpr double kThickness = 0.010;  // distance kept from colliders
constexpr double kFloor = 0.003;
constexpr double kFriction = 0.15;
constexpr double kMaxSpeed = 25;

}  // namespace

ClothSimulator::ClothSimulator(const ClothModel& model, const Eigen::Matrix3Xd& positions,
                               const CapsuleSet& colliders)
    : model_(model),
      stretch_(Constraints(model.stretch)),
      bend_(Constraints(model.bend)),
      positions_(positions),
      previous_(positions),
      velocities_(Eigen::Matrix3Xd::Zero(3, positions.cols())),
      targets_before_(positions),
      colliders_before_(colliders) {}

void ClothSimulator::Step(double step_s, const Eigen::Matrix3Xd& targets,
                          const CapsuleSet& colliders, double damping_per_s) {
  Predict(step_s, targets, damping_per_s);
  Satisfy(bend_, kBendCompliance, step_s);
  for (int i = 0; i < kStretchIterations; ++i) {
    Satisfy(stretch_, kStretchCompliance, step_s);
  }
  for (const ClothModel::Link& tether : model_.tethers) {
    const Vector3d reach = positions_.col(tether.b) - positions_.col(tether.a);
    const double length = reach.norm();
    if (length > tether.rest_m) {
      positions_.col(tether.b) = positions_.col(tether.a) + tether.rest_m / length * reach;
    }
  }
  LimitReach(targets);
  Collide(colliders);
  velocities_ = (positions_ - previous_) / step_s;
  for (Eigen::Index p = 0; p < velocities_.cols(); ++p) {
    const double speed = velocities_.col(p).norm();
    if (speed > kMaxSpeed) velocities_.col(p) *= kMaxSpeed / speed;
  }
  targets_before_ = targets;
  colliders_before_ = colliders;
}

void ClothSimulator::Predict(double step_s, const Eigen::Matrix3Xd& targets, double damping_per_s) {
  const double air = std::exp(-kAirDragPerS * step_s);
  const double free = std::exp(-damping_per_s * step_s);
  const double layer = std::exp(-kLayerDragPerS * step_s);
  previous_ = positions_;
  for (Eigen::Index p = 0; p < positions_.cols(); ++p) {
    if (model_.freedom_m[p] == 0) {
      positions_.col(p) = targets.col(p);
      continue;
    }
    Vector3d v = velocities_.col(p);
    const Vector3d body = (targets.col(p) - targets_before_.col(p)) / step_s;
    if (std::isinf(model_.freedom_m[p])) {
      const Vector3d against = free * (v - body);
      const double speed = against.norm();
      const double kept = speed > 0 ? std::max(0.0, 1 - kInnerFriction * step_s / speed) : 0.0;
      v = air * (body + kept * against);
    } else {
      v = body + layer * (v - body);
    }
    v.y() -= kGravity * step_s;
    positions_.col(p) += step_s * v;
  }
}

// In their order, from the waist down, which carries weight best. But within a stretch of about one ring
// they stand in groups without a particle in common, so that the processor need not wait for one link
// before it begins the next.
std::vector<ClothSimulator::Constraint> ClothSimulator::Constraints(
    const std::vector<ClothModel::Link>& links) const {
  constexpr size_t kTogether = 200;
  std::vector<Constraint> constraints;
  std::vector<uint32_t> taken(model_.freedom_m.size());  // groups of each particle, as bits
  for (size_t begin = 0; begin < links.size(); begin += kTogether) {
    const size_t end = std::min(begin + kTogether, links.size());
    std::array<std::vector<Constraint>, 33> groups;
    for (size_t i = begin; i < end; ++i) taken[links[i].a] = taken[links[i].b] = 0;
    for (size_t i = begin; i < end; ++i) {
      const auto& [a, b, rest_m] = links[i];
      const double mass_a = model_.freedom_m[a] > 0 ? 1 : 0;  // inverse masses
      const double mass_b = model_.freedom_m[b] > 0 ? 1 : 0;
      if (mass_a + mass_b == 0) continue;
      const int group = std::countr_one(taken[a] | taken[b]);
      const uint32_t bit = group < 32 ? uint32_t{1} << group : 0;
      taken[a] |= bit;
      taken[b] |= bit;
      groups[group].push_back({a, b, mass_a, mass_b, rest_m});
    }
    for (const auto& group : groups) {
      constraints.insert(constraints.end(), group.begin(), group.end());
    }
  }
  return constraints;
}

void ClothSimulator::Satisfy(const std::vector<Constraint>& constraints, double compliance,
                             double step_s) {
  const double alpha = compliance / (step_s * step_s);
  for (const Constraint& c : constraints) {
    const Vector3d d = positions_.col(c.b) - positions_.col(c.a);
    const double length = d.norm();
    if (length < 1e-9) continue;
    const double lambda = (length - c.rest_m) / (c.mass_a + c.mass_b + alpha);  // Eq. 18
    const Vector3d move = lambda / length * d;
    positions_.col(c.a) += c.mass_a * move;
    positions_.col(c.b) -= c.mass_b * move;
  }
}

void ClothSimulator::LimitReach(const Eigen::Matrix3Xd& targets) {
  for (Eigen::Index p = 0; p < positions_.cols(); ++p) {
    if (std::isinf(model_.freedom_m[p])) continue;
    const Vector3d away = positions_.col(p) - targets.col(p);
    const double distance = away.norm();
    if (distance > model_.freedom_m[p]) {
      positions_.col(p) = targets.col(p) + model_.freedom_m[p] / distance * away;
    }
  }
}

void ClothSimulator::Collide(const CapsuleSet& colliders) {
  for (size_t c = 0; c < colliders.size(); ++c) {
    const Capsule& capsule = colliders[c];
    const Capsule& before = colliders_before_[c];
    const Vector3d along = capsule.b - capsule.a;
    const double squared = along.squaredNorm();
    const double per_squared = squared > 0 ? 1 / squared : 0;
    for (Eigen::Index p = 0; p < positions_.cols(); ++p) {
      if (!model_.collides[p]) continue;
      Vector3d x = positions_.col(p);
      const double s = std::clamp(along.dot(x - capsule.a) * per_squared, 0.0, 1.0);
      const Vector3d out = x - capsule.a - s * along;
      const double radius =
          capsule.radius_a + s * (capsule.radius_b - capsule.radius_a) + kThickness;
      const double distance_squared = out.squaredNorm();
      if (distance_squared >= radius * radius || distance_squared < 1e-18) continue;
      const double distance = std::sqrt(distance_squared);
      const Vector3d normal = out / distance;
      x += (radius - distance) * normal;
      // Friction against the place of the body it lies on.
      const Vector3d carried = (1 - s) * (capsule.a - before.a) + s * (capsule.b - before.b);
      Vector3d slip = x - previous_.col(p) - carried;
      slip -= slip.dot(normal) * normal;
      const double slipped = slip.norm();
      if (slipped > 0) x -= std::min(1.0, kFriction * (radius - distance) / slipped) * slip;
      positions_.col(p) = x;
    }
  }
  for (Eigen::Index p = 0; p < positions_.cols(); ++p) {
    if (model_.freedom_m[p] > 0) positions_(1, p) = std::max(positions_(1, p), kFloor);
  }
}

}  // namespace mpc
