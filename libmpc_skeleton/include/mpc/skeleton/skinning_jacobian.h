// Purpose: analytic derivative of dual-quaternion-skinned vertices with respect to the pose.
// Source: Kavan et al. 2007; paper, Section 5.2 (v_k(S_f) inside E_con).
// Units: metres, radians. Symbols: N dofs. Double precision: it feeds solvers.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {

// Position of one vertex (body frame, double) and, if `jacobian` is given, its derivative 3 x N
// with columns as in JointJacobian (columns 3..5: left rotation of the root). `jacobian` is sized
// by the function. O(K N). Throws Error (kInvalidArgument) for a vertex out of range.
Eigen::Vector3d SkinnedVertex(const Character& character, const KinematicState& state, int vertex,
                              Eigen::Matrix3Xd* jacobian = nullptr);

// A rigid motion from the bind pose, or a blend of several, in double (mpc/skeleton/skinning.h).
struct DualQuaterniond {
  Eigen::Quaterniond real = {0, 0, 0, 0};
  Eigen::Quaterniond dual = {0, 0, 0, 0};
};

// The same for many vertices of one pose: what they share is computed once. Refers to the character,
// which must outlive it. Vertices must be in range, they are not checked. Not thread-safe.
class VertexSkinner {
 public:
  explicit VertexSkinner(const Character& character) : character_(&character) {}

  // Sets the pose; nothing else may be called before.
  void Update(const KinematicState& state);

  Eigen::Vector3d Position(int vertex) const;

  // d (direction . x) / d pose of a vertex x, written to `row` (N).
  void Derivative(int vertex, const Eigen::Vector3d& direction,
                  Eigen::Ref<Eigen::VectorXd> row) const;

 private:
  DualQuaterniond Blend(int vertex) const;

  struct Motion {
    DualQuaterniond motion;
    // Its derivative by a twist of the segment: real by angular and dual by linear, dual by angular.
    Eigen::Matrix<double, 4, 3> real_factor, dual_factor;
  };

  const Character* character_;
  Eigen::Vector3d root_ = Eigen::Vector3d::Zero();
  std::vector<Motion> motions_;                            // S
  std::vector<int> hinge_begin_;                           // S+1
  Eigen::Matrix<double, 6, Eigen::Dynamic> hinge_twists_;  // 6xH: axis, origin x axis
  // Scratch, 6xS: what a twist of the segment (angular, linear) does to the vertex.
  mutable Eigen::Matrix<double, 6, Eigen::Dynamic> twists_;
};

}  // namespace mpc
