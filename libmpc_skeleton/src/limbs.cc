#include "mpc/skeleton/limbs.h"

#include <algorithm>
#include <limits>

namespace mpc {
namespace {

using Eigen::Vector3d;

std::vector<Limb> Bones(const Skeleton& skeleton) {
  std::vector<Limb> bones;
  std::vector<bool> has_child(static_cast<size_t>(skeleton.num_segments()), false);
  for (const Segment& segment : skeleton.segments) {
    if (segment.parent < 0) continue;
    has_child[static_cast<size_t>(segment.parent)] = true;
    bones.push_back({.segment = segment.parent, .end_in_segment = segment.offset});
  }
  for (int s = 0; s < skeleton.num_segments(); ++s) {
    if (has_child[static_cast<size_t>(s)]) continue;
    Limb bone = {.segment = s};
    for (const SkeletonJoint& joint : skeleton.joints) {
      if (joint.segment == s && joint.x_in_segment.norm() > bone.end_in_segment.norm()) {
        bone.end_in_segment = joint.x_in_segment;
      }
    }
    bones.push_back(bone);
  }
  std::erase_if(bones, [](const Limb& bone) { return bone.end_in_segment.norm() < 1e-6; });
  return bones;
}

// Distance of x from a bone that starts at the origin; infinity beyond its ends.
double DistanceBeside(const Vector3d& x, const Vector3d& bone) {
  const double along = x.dot(bone) / bone.squaredNorm();
  if (along < 0 || along > 1) return std::numeric_limits<double>::infinity();
  return (x - along * bone).norm();
}

}  // namespace

std::vector<Limb> FindLimbs(const Character& character) {
  std::vector<Limb> limbs = Bones(character.skeleton);
  std::vector<std::vector<double>> distances(limbs.size());
  for (Eigen::Index v = 0; v < character.mesh.positions.cols(); ++v) {
    Eigen::Index heaviest = 0;
    character.weights.col(v).maxCoeff(&heaviest);
    const int segment = character.segments(heaviest, v);
    const Vector3d x_at_bind = character.mesh.positions.col(v).cast<double>();
    const Vector3d x = character.bind.rotations[static_cast<size_t>(segment)].transpose() *
                       (x_at_bind - character.bind.origins.col(segment));
    double nearest = std::numeric_limits<double>::infinity();
    size_t limb = 0;
    for (size_t i = 0; i < limbs.size(); ++i) {
      if (limbs[i].segment != segment) continue;
      const double distance = DistanceBeside(x, limbs[i].end_in_segment);
      if (distance >= nearest) continue;
      nearest = distance;
      limb = i;
    }
    if (nearest < std::numeric_limits<double>::infinity()) distances[limb].push_back(nearest);
  }
  for (size_t i = 0; i < limbs.size(); ++i) {
    if (distances[i].empty()) continue;
    const auto middle = distances[i].begin() + static_cast<std::ptrdiff_t>(distances[i].size() / 2);
    std::nth_element(distances[i].begin(), middle, distances[i].end());
    limbs[i].radius = *middle;
  }
  return limbs;
}

CapsuleSet PoseLimbs(const std::vector<Limb>& limbs, const KinematicState& state) {
  CapsuleSet capsules;
  for (const Limb& limb : limbs) {
    const Eigen::Matrix3d& rotation = state.rotations[static_cast<size_t>(limb.segment)];
    const Vector3d origin = state.origins.col(limb.segment);
    capsules.push_back({.a = origin,
                        .b = origin + rotation * limb.end_in_segment,
                        .radius_a = limb.radius,
                        .radius_b = limb.radius});
  }
  return capsules;
}

}  // namespace mpc
