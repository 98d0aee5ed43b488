// Purpose: the capture skeleton as data: rigid segments, hinges with bounds, observed joints.
// Source: paper, Section 4 (S = {t, R, Theta}, 16 joints, 27 angles); bounds cited in skeleton.cc.
// Units: metres, radians. Symbols: S segments, H hinges, J joints, N = 6 + H dofs, F frames.
//
// A pose is a column of N numbers: root translation t (3, metres), root rotation as a rotation
// vector (3, rad), then one angle per hinge in the order of `hinges`. Several poses are N x F.
// With all angles zero the default skeleton stands in a T-pose: arms out, palms down, facing +z of
// its root frame, y up, left = +x.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "mpc/core/joints.h"

namespace mpc {

// A rigid body. At zero angles: parent_from_segment = (rest_rotation, offset). The hinges of the
// segment rotate it about its own origin, each in the frame left by the hinges before it.
struct Segment {
  std::string name;
  int parent = -1;  // index of an earlier segment; -1 for the root: segment 0, at identity
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();             // origin in the parent
  Eigen::Matrix3d rest_rotation = Eigen::Matrix3d::Identity();  // parent from segment
};

struct Hinge {
  std::string name;
  int segment = 0;                                  // hinges are ordered by segment
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  // unit, in the segment
  double min_rad = 0;
  double max_rad = 0;
};

// An observed point fixed in a segment.
struct SkeletonJoint {
  JointId id = JointId::kNeck;
  int segment = 0;
  Eigen::Vector3d x_in_segment = Eigen::Vector3d::Zero();
};

struct Skeleton {
  std::vector<Segment> segments;  // parents before children
  std::vector<Hinge> hinges;
  std::vector<SkeletonJoint> joints;  // the 16 of the paper first, in JointId order

  int num_dofs() const { return 6 + static_cast<int>(hinges.size()); }
  int num_joints() const { return static_cast<int>(joints.size()); }
  int num_segments() const { return static_cast<int>(segments.size()); }

  // Index of a segment or joint, or -1.
  int FindSegment(std::string_view name) const;
  int FindJointIndex(JointId id) const;

  // Bounds of a pose, N each; +-infinity for the six root dofs.
  Eigen::VectorXd LowerBounds() const;
  Eigen::VectorXd UpperBounds() const;

  // Throws Error (kInvalidArgument) naming every fault: parents, order, axes, bounds, joints.
  void Validate() const;
};

// Indices into Skeleton::segments of the default skeleton.
enum DefaultSegment {
  kPelvisSegment,
  kChestSegment,
  kNeckSegment,
  kHeadSegment,
  kLeftUpperArmSegment,
  kLeftForearmSegment,
  kRightUpperArmSegment,
  kRightForearmSegment,
  kLeftThighSegment,
  kLeftShankSegment,
  kLeftFootSegment,
  kRightThighSegment,
  kRightShankSegment,
  kRightFootSegment,
  kNumDefaultSegments,
};

// The paper's skeleton for an adult of the given height (m): 14 segments, 27 hinges, the 16 joints
// and all extra points of JointId. At zero angles every segment's axes are the root's. Segment
// lengths as fractions of height after Winter, "Biomechanics and Motor Control of Human Movement",
// 4th ed., Fig. 4.1.
Skeleton DefaultSkeleton(double height_m = 1.75);

// A pose of N zeros.
Eigen::VectorXd ZeroPose(const Skeleton& skeleton);

}  // namespace mpc
