#include "mpc/skeleton/skeleton.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "mpc/core/error.h"
#include "mpc/core/units.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

// Ranges of motion in degrees. Sources:
//   [AAOS]  American Academy of Orthopaedic Surgeons, "Joint Motion: Method of Measuring and
//           Recording", 1965 (as tabulated in Norkin & White, "Measurement of Joint Motion").
//   [Kap]   Kapandji, "The Physiology of the Joints".
//   [Inman] Inman, "The Joints of the Ankle", 1976 (subtalar axis 42 deg up, 23 deg medial).
// Clavicles are rigid here, so shoulder ranges include the motion of the shoulder girdle.
struct HingeSpec {
  const char* name;
  int segment;
  Vector3d axis;
  double min_deg;
  double max_deg;
};

// The subtalar axis of the left foot; positive rotation is eversion.
Vector3d LeftSubtalarAxis() {
  const double inclination = 42 * kDegree;
  const double deviation = 23 * kDegree;
  return {-std::sin(deviation) * std::cos(inclination), std::sin(inclination),
          std::cos(deviation) * std::cos(inclination)};
}

// Rotation axes are axial vectors: mirroring at the plane x = 0 keeps x and flips y and z.
Vector3d MirrorAxis(const Vector3d& axis) { return {axis.x(), -axis.y(), -axis.z()}; }
Vector3d MirrorPoint(const Vector3d& point) { return {-point.x(), point.y(), point.z()}; }

void AddHinges(std::vector<Hinge>* hinges) {
  const Vector3d x = Vector3d::UnitX();
  const Vector3d y = Vector3d::UnitY();
  const Vector3d z = Vector3d::UnitZ();
  const std::vector<HingeSpec> middle = {
      {"spine_flexion", kChestSegment, x, -30, 85},  // [AAOS] thoracolumbar
      {"spine_lateral", kChestSegment, z, -35, 35},  // [AAOS]
      {"spine_twist", kChestSegment, y, -45, 45},    // [AAOS]
      {"neck_flexion", kNeckSegment, x, -45, 45},    // [AAOS] cervical
      {"neck_lateral", kNeckSegment, z, -45, 45},    // [AAOS]
      {"neck_twist", kNeckSegment, y, -70, 70},      // [AAOS] 60, [Kap] 80
      {"head_nod", kHeadSegment, x, -20, 20},        // [Kap] atlanto-occipital
  };
  const std::vector<HingeSpec> left_arm = {
      // From arms straight down (-90) to straight up; adduction in front of the body 40. [AAOS]
      {"shoulder_abduction", kLeftUpperArmSegment, z, -130, 95},
      // Backward extension 60; forward flexion with the arm low reaches the sagittal 150. [AAOS]
      {"shoulder_flexion", kLeftUpperArmSegment, -y, -60, 150},
      // External (negative) 90, internal 70, widened by the forearm's share. [AAOS]
      {"shoulder_twist", kLeftUpperArmSegment, x, -100, 90},
      {"elbow_flexion", kLeftForearmSegment, -y, 0, 150},  // [AAOS]
  };
  const std::vector<HingeSpec> left_leg = {
      {"hip_flexion", kLeftThighSegment, -x, -30, 125},  // [AAOS] 120, extension 30
      {"hip_abduction", kLeftThighSegment, z, -30, 50},  // [AAOS] 45, adduction 30
      {"hip_twist", kLeftThighSegment, y, -45, 45},      // [AAOS] rotation 45 each way
      {"knee_flexion", kLeftShankSegment, x, 0, 150},    // [AAOS] 135, [Kap] 160 passive
      {"ankle_flexion", kLeftFootSegment, -x, -50, 25},  // [AAOS] plantar 50, dorsal 20
      {"ankle_eversion", kLeftFootSegment, LeftSubtalarAxis(), -35, 20},  // [Inman], [AAOS]
  };
  const auto add = [hinges](const HingeSpec& spec, const std::string& prefix, int segment,
                            const Vector3d& axis) {
    hinges->push_back(
        {prefix + spec.name, segment, axis, spec.min_deg * kDegree, spec.max_deg * kDegree});
  };
  for (const HingeSpec& spec : middle) add(spec, "", spec.segment, spec.axis);
  for (const HingeSpec& spec : left_arm) add(spec, "left_", spec.segment, spec.axis);
  for (const HingeSpec& spec : left_arm) {
    add(spec, "right_", spec.segment + (kRightUpperArmSegment - kLeftUpperArmSegment),
        MirrorAxis(spec.axis));
  }
  for (const HingeSpec& spec : left_leg) add(spec, "left_", spec.segment, spec.axis);
  for (const HingeSpec& spec : left_leg) {
    add(spec, "right_", spec.segment + (kRightThighSegment - kLeftThighSegment),
        MirrorAxis(spec.axis));
  }
}

}  // namespace

int Skeleton::FindSegment(std::string_view name) const {
  for (int s = 0; s < num_segments(); ++s) {
    if (segments[s].name == name) return s;
  }
  return -1;
}

int Skeleton::FindJointIndex(JointId id) const {
  for (int j = 0; j < num_joints(); ++j) {
    if (joints[j].id == id) return j;
  }
  return -1;
}

Eigen::VectorXd Skeleton::LowerBounds() const {
  Eigen::VectorXd bounds(num_dofs());
  bounds.head<6>().setConstant(-std::numeric_limits<double>::infinity());
  for (size_t h = 0; h < hinges.size(); ++h) bounds[6 + h] = hinges[h].min_rad;
  return bounds;
}

Eigen::VectorXd Skeleton::UpperBounds() const {
  Eigen::VectorXd bounds(num_dofs());
  bounds.head<6>().setConstant(std::numeric_limits<double>::infinity());
  for (size_t h = 0; h < hinges.size(); ++h) bounds[6 + h] = hinges[h].max_rad;
  return bounds;
}

void Skeleton::Validate() const {
  std::string faults;
  const auto fault = [&faults](const std::string& text) {
    faults += (faults.empty() ? "" : "; ") + text;
  };
  if (segments.empty()) fault("no segments");
  for (int s = 0; s < num_segments(); ++s) {
    const Segment& segment = segments[s];
    const bool parent_ok =
        s == 0 ? segment.parent == -1 : segment.parent >= 0 && segment.parent < s;
    if (!parent_ok) fault(fmt::format("segment {} has parent {}", s, segment.parent));
    const Eigen::Matrix3d& rotation = segment.rest_rotation;
    if (!segment.offset.allFinite() || !rotation.allFinite() ||
        (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() > 1e-6 ||
        rotation.determinant() < 0) {
      fault(fmt::format("segment {} is not placed by a rigid transform", s));
    } else if (s == 0 && (!segment.offset.isZero() || !rotation.isIdentity())) {
      fault("the root segment is not at the identity");
    }
  }
  for (size_t h = 0; h < hinges.size(); ++h) {
    const Hinge& hinge = hinges[h];
    if (hinge.segment < 1 || hinge.segment >= num_segments() ||
        (h > 0 && hinge.segment < hinges[h - 1].segment)) {
      fault(fmt::format("hinge {} is on segment {}, out of order or range", h, hinge.segment));
    }
    if (!(std::abs(hinge.axis.norm() - 1) < 1e-6)) {
      fault(fmt::format("hinge {} has an axis of length {}", h, hinge.axis.norm()));
    }
    if (!(hinge.min_rad <= hinge.max_rad)) {
      fault(fmt::format("hinge {} has bounds {} to {}", h, hinge.min_rad, hinge.max_rad));
    }
  }
  for (int j = 0; j < num_joints(); ++j) {
    if (joints[j].segment < 0 || joints[j].segment >= num_segments()) {
      fault(fmt::format("joint {} is on segment {}", JointName(joints[j].id), joints[j].segment));
    }
    if (!joints[j].x_in_segment.allFinite()) {
      fault(fmt::format("joint {} has a non-finite position", JointName(joints[j].id)));
    }
    if (FindJointIndex(joints[j].id) != j) {
      fault(fmt::format("joint {} appears twice", JointName(joints[j].id)));
    }
  }
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "invalid skeleton: " + faults);
}

Skeleton DefaultSkeleton(double height_m) {
  const double h = height_m;
  Skeleton skeleton;
  skeleton.segments.resize(kNumDefaultSegments);
  const auto segment = [&](int index, const char* name, int parent, const Vector3d& offset) {
    skeleton.segments[index] = {name, parent, offset * h, Eigen::Matrix3d::Identity()};
  };
  segment(kPelvisSegment, "pelvis", -1, {0, 0, 0});
  segment(kChestSegment, "chest", kPelvisSegment, {0, 0.100, 0});
  segment(kNeckSegment, "neck", kChestSegment, {0, 0.210, 0});
  segment(kHeadSegment, "head", kNeckSegment, {0, 0.060, 0});
  const auto limb = [&](int left, int right, const char* name, int left_parent, int right_parent,
                        const Vector3d& offset) {
    skeleton.segments[left] = {std::string("left_") + name, left_parent, offset * h,
                               Eigen::Matrix3d::Identity()};
    skeleton.segments[right] = {std::string("right_") + name, right_parent, MirrorPoint(offset) * h,
                                Eigen::Matrix3d::Identity()};
  };
  limb(kLeftUpperArmSegment, kRightUpperArmSegment, "upper_arm", kChestSegment, kChestSegment,
       {0.105, 0.188, 0});
  limb(kLeftForearmSegment, kRightForearmSegment, "forearm", kLeftUpperArmSegment,
       kRightUpperArmSegment, {0.186, 0, 0});
  limb(kLeftThighSegment, kRightThighSegment, "thigh", kPelvisSegment, kPelvisSegment,
       {0.055, 0, 0});
  limb(kLeftShankSegment, kRightShankSegment, "shank", kLeftThighSegment, kRightThighSegment,
       {0, -0.245, 0});
  limb(kLeftFootSegment, kRightFootSegment, "foot", kLeftShankSegment, kRightShankSegment,
       {0, -0.246, 0});
  AddHinges(&skeleton.hinges);
  std::stable_sort(skeleton.hinges.begin(), skeleton.hinges.end(),
                   [](const Hinge& a, const Hinge& b) { return a.segment < b.segment; });

  const auto joint = [&](JointId id, int on_segment, const Vector3d& x) {
    skeleton.joints.push_back({id, on_segment, x * h});
  };
  const auto pair = [&](JointId left_id, int left, int right, const Vector3d& x) {
    joint(left_id, left, x);
    joint(MirrorJoint(left_id), right, MirrorPoint(x));
  };
  joint(JointId::kHeadTop, kHeadSegment, {0, 0.100, 0});
  joint(JointId::kNeck, kChestSegment, {0, 0.210, 0});
  pair(JointId::kLeftShoulder, kLeftUpperArmSegment, kRightUpperArmSegment, {0, 0, 0});
  pair(JointId::kLeftElbow, kLeftForearmSegment, kRightForearmSegment, {0, 0, 0});
  pair(JointId::kLeftWrist, kLeftForearmSegment, kRightForearmSegment, {0.146, 0, 0});
  pair(JointId::kLeftHip, kLeftThighSegment, kRightThighSegment, {0, 0, 0});
  pair(JointId::kLeftKnee, kLeftShankSegment, kRightShankSegment, {0, 0, 0});
  pair(JointId::kLeftAnkle, kLeftFootSegment, kRightFootSegment, {0, 0, 0});
  pair(JointId::kLeftToe, kLeftFootSegment, kRightFootSegment, {-0.005, -0.033, 0.112});
  joint(JointId::kPelvis, kPelvisSegment, {0, 0, 0});
  pair(JointId::kLeftHeel, kLeftFootSegment, kRightFootSegment, {0, -0.035, -0.036});
  pair(JointId::kLeftSmallToe, kLeftFootSegment, kRightFootSegment, {0.030, -0.035, 0.090});
  joint(JointId::kNose, kHeadSegment, {0, 0.020, 0.062});
  pair(JointId::kLeftEye, kHeadSegment, kHeadSegment, {0.018, 0.038, 0.050});
  pair(JointId::kLeftEar, kHeadSegment, kHeadSegment, {0.042, 0.028, 0});
  return skeleton;
}

Eigen::VectorXd ZeroPose(const Skeleton& skeleton) {
  return Eigen::VectorXd::Zero(skeleton.num_dofs());
}

}  // namespace mpc
