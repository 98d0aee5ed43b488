// Purpose: which parts of the body may stand for one another when the model's outline is compared
// with a silhouette: a toe never matches a heel, the other foot or the other hand.
// Source: ours, against the paper's third limitation. Units: metres. Symbols: V vertices.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/skeleton/character.h"

namespace mpc {

class BodyParts {
 public:
  // reach: how far apart two vertices may lie on the body at bind, in parts of the mesh's height
  // there. A foot is 0.15 long, so that half a foot, the default, keeps toe and heel apart.
  // Throws Error (kInvalidArgument) for a reach that is not positive.
  explicit BodyParts(const Character& character, double reach = 0.075);

  int num_parts() const { return num_parts_; }

  // The segment that moves the vertex most.
  int part(int vertex) const { return parts_[static_cast<size_t>(vertex)]; }

  // True when both vertices follow the same segment or two that a joint connects, and lie within
  // reach of each other at bind.
  bool Compatible(int vertex, int other) const;

 private:
  int num_parts_;
  std::vector<int> parts_;    // V
  std::vector<int> parents_;  // of the parts
  Eigen::Matrix3Xf at_bind_;  // 3xV
  float reach_m_;
};

}  // namespace mpc
