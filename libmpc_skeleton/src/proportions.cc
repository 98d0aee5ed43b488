#include "mpc/skeleton/proportions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mpc/core/error.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr double kMinScale = 0.2;
constexpr double kMaxScale = 5;

void CheckScale(double scale, const char* name) {
  if (scale >= kMinScale && scale <= kMaxScale) return;
  throw Error(ErrorCode::kInvalidArgument, fmt::format("scale of {} is {}, expected {} to {}", name,
                                                       scale, kMinScale, kMaxScale));
}

// Scales of a segment along its own axes (x left, y up, z forward in a T-pose): bones in their
// length, the trunk in height and width, head and feet as a whole.
Vector3d SegmentScale(const std::string& segment, const Proportions& proportions) {
  const auto part = [&](BodyPart p) { return proportions.part[static_cast<size_t>(p)]; };
  Vector3d scale = Vector3d::Ones();
  if (segment == "pelvis") {
    scale = {part(BodyPart::kHips), part(BodyPart::kTorso), 1};
  } else if (segment == "chest") {
    scale = {part(BodyPart::kShoulders), part(BodyPart::kTorso), 1};
  } else if (segment == "neck" || segment == "head") {
    scale.setConstant(part(BodyPart::kHead));
  } else if (segment.ends_with("_upper_arm")) {
    scale.x() = part(BodyPart::kUpperArm);
  } else if (segment.ends_with("_forearm")) {
    scale.x() = part(BodyPart::kForearm);
  } else if (segment.ends_with("_thigh")) {
    scale.y() = part(BodyPart::kThigh);
  } else if (segment.ends_with("_shank")) {
    scale.y() = part(BodyPart::kShank);
  } else if (segment.ends_with("_foot")) {
    scale.setConstant(part(BodyPart::kFoot));
  }
  return proportions.overall * scale;
}

}  // namespace

const char* BodyPartName(BodyPart part) {
  constexpr const char* kNames[kNumBodyParts] = {
      "torso", "shoulders", "hips", "head", "upper_arm", "forearm", "thigh", "shank", "foot"};
  return kNames[static_cast<size_t>(part)];
}

Skeleton ScaledSkeleton(const Skeleton& skeleton, const Proportions& proportions) {
  CheckScale(proportions.overall, "the whole body");
  for (int p = 0; p < kNumBodyParts; ++p) {
    CheckScale(proportions.part[p], BodyPartName(static_cast<BodyPart>(p)));
  }
  Skeleton scaled = skeleton;
  std::vector<Vector3d> scales;
  for (Segment& segment : scaled.segments) {
    scales.push_back(SegmentScale(segment.name, proportions));
    if (segment.parent >= 0) segment.offset = scales[segment.parent].cwiseProduct(segment.offset);
  }
  for (SkeletonJoint& joint : scaled.joints) {
    joint.x_in_segment = scales[joint.segment].cwiseProduct(joint.x_in_segment);
  }
  return scaled;
}

void ApplyProportions(const Proportions& proportions, Character* character, RigAsset* rig) {
  const Eigen::Index num_vertices = character->mesh.positions.cols();
  if (num_vertices != rig->num_vertices() || character->bone_segment.size() != rig->bones.size()) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{}: a character with {} vertices and {} bones does not belong to a "
                            "rig with {} and {}",
                            rig->source, num_vertices, character->bone_segment.size(),
                            rig->num_vertices(), rig->bones.size()));
  }
  const Skeleton scaled = ScaledSkeleton(character->skeleton, proportions);
  const KinematicState old_bind = character->bind;
  Eigen::VectorXd bind_pose = character->bind_pose;
  bind_pose.head<3>() *= proportions.overall;
  KinematicState bind;
  ForwardKinematics(scaled, bind_pose, &bind);

  // At bind each segment stretches along its own axes about its origin, then moves with it.
  std::vector<Eigen::Affine3d> stretch(scaled.segments.size());
  for (size_t s = 0; s < stretch.size(); ++s) {
    const Vector3d scale = SegmentScale(scaled.segments[s].name, proportions);
    stretch[s].linear() =
        bind.rotations[s] * scale.asDiagonal() * old_bind.rotations[s].transpose();
    stretch[s].translation() = bind.origins.col(s) - stretch[s].linear() * old_bind.origins.col(s);
  }
  Eigen::Matrix3Xd positions = Eigen::Matrix3Xd::Zero(3, num_vertices);
  for (Eigen::Index v = 0; v < num_vertices; ++v) {
    const Vector3d x = character->mesh.positions.col(v).cast<double>();
    double sum = 0;
    for (Eigen::Index k = 0; k < character->segments.rows(); ++k) {
      const double weight = character->weights(k, v);
      positions.col(v) += weight * (stretch[character->segments(k, v)] * x);
      sum += weight;
    }
    positions.col(v) /= sum;
  }
  const double lift = static_cast<double>(character->mesh.positions.row(1).minCoeff()) -
                      positions.row(1).minCoeff();
  positions.row(1).array() += lift;
  bind_pose.y() += lift;

  for (size_t b = 0; b < rig->bones.size(); ++b) {
    Eigen::Affine3d& scene_from_bone = rig->bones[b].scene_from_bone;
    const Vector3d moved = stretch[character->bone_segment[b]] * scene_from_bone.translation();
    scene_from_bone.translation() = moved + lift * Vector3d::UnitY();
  }
  Eigen::Index first = 0;
  for (RigMesh& mesh : rig->meshes) {
    const Eigen::Index count = mesh.mesh.positions.cols();
    mesh.mesh.positions = positions.middleCols(first, count).cast<float>();
    first += count;
  }
  character->mesh.positions = positions.cast<float>();
  character->skeleton = scaled;
  character->bind_pose = bind_pose;
  ForwardKinematics(scaled, bind_pose, &character->bind);
}

double ActorHeight(const Character& character) {
  const auto y = character.mesh.positions.row(1);
  return static_cast<double>(y.maxCoeff() - y.minCoeff());
}

double ScaleToHeight(double height_m, Character* character, RigAsset* rig) {
  const double scale = height_m / ActorHeight(*character);
  if (!(scale > 1e-9 && scale < 1e9)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("an actor of {:.4g} m cannot be scaled to {:.4g} m",
                            ActorHeight(*character), height_m));
  }
  // In steps that ApplyProportions allows.
  for (double rest = scale; std::abs(rest - 1) > 1e-12;) {
    Proportions step;
    step.overall = std::clamp(rest, 0.25, 4.0);
    ApplyProportions(step, character, rig);
    rest /= step.overall;
  }
  return scale;
}

}  // namespace mpc
