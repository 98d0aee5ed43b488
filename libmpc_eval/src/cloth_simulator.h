// Purpose: particles with distance constraints that are pulled along by a body.
// Source: Macklin et al. 2016, "XPBD: Position-Based Simulation of Compliant Constrained Dynamics",
// Eq. 18 (multiplier of one distance constraint), one iteration per substep as in Macklin et al.
// 2019, "Small Steps in Physics Simulation".
// Frames: world, y up, floor at y = 0. Units: metres, seconds. Symbols: P particles.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/capsule_set.h"
#include "mpc/eval/dressed_actor.h"

namespace mpc {

class ClothSimulator {
 public:
  // Keeps a reference to the model. Starts at rest at `positions` (3xP).
  ClothSimulator(const ClothModel& model, const Eigen::Matrix3Xd& positions,
                 const CapsuleSet& colliders);

  // One substep: `targets` (3xP) is where the bones hold the particles, `colliders` (one per
  // collider of the model) where the body is at its end. What hangs free loses its motion against
  // the bones at `damping_per_s`. No allocation.
  void Step(double step_s, const Eigen::Matrix3Xd& targets, const CapsuleSet& colliders,
            double damping_per_s);

  const Eigen::Matrix3Xd& positions() const { return positions_; }
  // Moves everything by `velocity`, in m/s.
  void Push(const Eigen::Vector3d& velocity) { velocities_.colwise() += velocity; }

 private:
  void Predict(double step_s, const Eigen::Matrix3Xd& targets, double damping_per_s);
  // A link that can move something, with the inverse masses of its ends.
  struct Constraint {
    int a, b;
    double mass_a, mass_b;
    double rest_m;
  };
  std::vector<Constraint> Constraints(const std::vector<ClothModel::Link>& links) const;
  void Satisfy(const std::vector<Constraint>& constraints, double compliance, double step_s);
  void LimitReach(const Eigen::Matrix3Xd& targets);
  void Collide(const CapsuleSet& colliders);

  const ClothModel& model_;
  std::vector<Constraint> stretch_, bend_;
  Eigen::Matrix3Xd positions_, previous_, velocities_, targets_before_;
  CapsuleSet colliders_before_;
};

}  // namespace mpc
