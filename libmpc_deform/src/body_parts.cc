#include "mpc/deform/body_parts.h"

#include <fmt/format.h>

#include "mpc/core/error.h"

namespace mpc {

BodyParts::BodyParts(const Character& character, double reach)
    : num_parts_(character.skeleton.num_segments()), at_bind_(character.mesh.positions) {
  if (!(reach > 0)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("reach on the body is {}, expected a positive number", reach));
  }
  for (const Segment& segment : character.skeleton.segments) parents_.push_back(segment.parent);
  for (Eigen::Index v = 0; v < at_bind_.cols(); ++v) parts_.push_back(character.segments(0, v));
  // Only vertices of triangles: strays would make the body larger than it is.
  float low = 0, high = 0;
  for (Eigen::Index i = 0; i < character.mesh.triangles.size(); ++i) {
    const float y = at_bind_(1, character.mesh.triangles(i));
    low = i == 0 ? y : std::min(low, y);
    high = i == 0 ? y : std::max(high, y);
  }
  reach_m_ = static_cast<float>(reach) * (high - low);
}

bool BodyParts::Compatible(int vertex, int other) const {
  const int a = part(vertex), b = part(other);
  const bool adjacent =
      a == b || parents_[static_cast<size_t>(a)] == b || parents_[static_cast<size_t>(b)] == a;
  return adjacent && (at_bind_.col(vertex) - at_bind_.col(other)).norm() <= reach_m_;
}

}  // namespace mpc
