// Purpose: read and write Biovision BVH, and make one from captured poses.
// Source: Meredith and Maddock, "Motion Capture File Formats Explained", 2001.
// Frames: the file's own world, by custom y up. Symbols: B joints, C channels, F frames.
// Units: lengths in the file's own unit (BVH names none; the common mocap files are in
// centimetres), angles in degrees. BvhFromPoses makes metres, so import with scale 1.
//
// A joint's transform is parent_from_joint = T(offset) * R(c1) * R(c2) * R(c3) in the order of its
// channels. Position channels replace the offset (as Blender and most tools read them).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mpc/skeleton/skeleton.h"

namespace mpc {

enum class BvhChannel {
  kXPosition,
  kYPosition,
  kZPosition,
  kXRotation,
  kYRotation,
  kZRotation,
};

struct BvhJoint {
  std::string name;
  int parent = -1;  // an earlier joint; -1: root
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  std::vector<BvhChannel> channels;         // each at most once
  std::optional<Eigen::Vector3d> end_site;  // offset of the leaf's end
};

struct BvhMotion {
  std::vector<BvhJoint> joints;  // B, one or more roots, depth first
  double frame_time_s = 0;
  Eigen::MatrixXd values;  // CxF, rows in the order of the joints and their channels

  int num_frames() const { return static_cast<int>(values.cols()); }
  int FindJoint(const std::string& name) const;  // -1: not there

  // Throws Error (kInvalidArgument) naming the fault: parents, order, sizes, non-finite numbers.
  void Validate() const;
};

// Throws Error: kFileNotFound; kBadFile with the line and what was expected there.
BvhMotion ReadBvh(const std::filesystem::path& path);

// world_from_joint of every joint at a frame, B entries; columns of BvhJointPositions are their
// origins, 3xB. Throws Error (kInvalidArgument) for a frame out of range.
std::vector<Eigen::Isometry3d> BvhJointTransforms(const BvhMotion& motion, int frame);
Eigen::Matrix3Xd BvhJointPositions(const BvhMotion& motion, int frame);

// The paths of all joints and end sites (named after their joint, with "_end") in frames
// [begin, end): B + number of end sites. Throws Error (kInvalidArgument) for frames out of range.
struct BvhJointPaths {
  std::vector<std::string> names;
  std::vector<int> parents;                 // an earlier one or -1
  std::vector<Eigen::Matrix3Xd> positions;  // per frame, one column each
};
BvhJointPaths JointPathsOf(const BvhMotion& motion, int begin, int end);

// Lengths with 7, angles with 6 decimals. Throws Error: kInvalidArgument, kWriteFailed.
void WriteBvh(const std::filesystem::path& path, const BvhMotion& motion);

// One BVH joint per segment of the skeleton, with its name; end sites at the joints that lie
// farthest out in the leaf segments (head top, wrists, toes). `poses` is N x F in a y-up world.
// With all channels zero the BVH stands in the skeleton's T-pose and all its joint frames are
// parallel to the world. Euler angles are Z, X, Y and continuous from frame to frame.
// Throws Error (kInvalidArgument) for wrong sizes, no frame, non-finite poses, fps <= 0.
BvhMotion BvhFromPoses(const Skeleton& skeleton, const Eigen::MatrixXd& poses, double fps);

}  // namespace mpc
