// Purpose: what retargeting reads from a source motion: which joint is which, and where its limbs
// point.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "mpc/core/joints.h"
#include "mpc/eval/retarget.h"

namespace mpc {

// Index in the source of each of the 16 JointIds; toes and the head top may be missing (-1).
class JointMap {
 public:
  JointMap() { joints_.fill(-1); }
  int operator[](JointId id) const { return joints_[static_cast<size_t>(id)]; }
  int& operator[](JointId id) { return joints_[static_cast<size_t>(id)]; }

 private:
  std::array<int, kNumPaperJoints> joints_{};
};

// By name; throws Error (kUnsupported) for a motion without arms, legs or a neck.
JointMap MapSourceJoints(const SourceMotion& source);

// A direction from the middle of two points to the middle of two others.
struct Limb {
  std::array<JointId, 2> from;
  std::array<JointId, 2> to;
};
inline constexpr int kNumLimbs = 14;
extern const std::array<Limb, kNumLimbs> kLimbs;  // hip line first, trunk second, feet last

using LimbDirections = Eigen::Matrix<double, 3, kNumLimbs>;  // unit; zero where unknown

// Angle of a unit direction below the horizontal.
double PitchDown(const Eigen::Vector3d& direction);

// Limb directions of every frame. Feet are turned so that a foot that stands flat points down by
// `flat_pitch_rad`, our own foot's angle.
std::vector<LimbDirections> SourceDirections(const SourceMotion& source, const JointMap& map,
                                             double flat_pitch_rad);

}  // namespace mpc
