#include "mpc/io/bvh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "bvh_channels.h"
#include "mpc/core/error.h"
#include "mpc/core/units.h"
#include "mpc/io/atomic_file.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

constexpr std::array<BvhChannel, 3> kPositions = {BvhChannel::kXPosition, BvhChannel::kYPosition,
                                                  BvhChannel::kZPosition};
constexpr std::array<BvhChannel, 3> kRotations = {BvhChannel::kZRotation, BvhChannel::kXRotation,
                                                  BvhChannel::kYRotation};

// Angles (rad) with R = Rz(a) Rx(b) Ry(c), of the two solutions, each up to full turns, the one
// nearest to `previous`.
Eigen::Vector3d ContinuousZxy(const Eigen::Matrix3d& r, const Eigen::Vector3d& previous) {
  const double sin_b = std::clamp(r(2, 1), -1.0, 1.0);
  Eigen::Vector3d first;
  first[1] = std::asin(sin_b);
  if (std::abs(sin_b) > 1 - 1e-12) {  // only a +- c is determined: keep c
    first[2] = previous[2];
    const double sum = std::atan2(r(1, 0), r(0, 0));
    first[0] = sin_b > 0 ? sum - first[2] : sum + first[2];
  } else {
    first[0] = std::atan2(-r(0, 1), r(1, 1));
    first[2] = std::atan2(-r(2, 0), r(2, 2));
  }
  constexpr double kPi = std::numbers::pi;
  Eigen::Vector3d second(first[0] + kPi, kPi - first[1], first[2] + kPi);
  for (Eigen::Vector3d* angles : {&first, &second}) {
    for (int i = 0; i < 3; ++i) {
      (*angles)[i] += 2 * kPi * std::round((previous[i] - (*angles)[i]) / (2 * kPi));
    }
  }
  return (first - previous).squaredNorm() <= (second - previous).squaredNorm() ? first : second;
}

// The joint of a leaf segment that ends it: the paper's joint farthest from the segment's origin.
Eigen::Vector3d SegmentEnd(const Skeleton& skeleton, int segment) {
  Eigen::Vector3d end = Eigen::Vector3d::Zero();
  for (const SkeletonJoint& joint : skeleton.joints) {
    if (joint.segment != segment || static_cast<int>(joint.id) >= kNumPaperJoints) continue;
    if (joint.x_in_segment.norm() > end.norm()) end = joint.x_in_segment;
  }
  return end;
}

// Segments in depth-first order, as the nesting of a BVH file has them.
std::vector<int> DepthFirst(const Skeleton& skeleton) {
  std::vector<int> order;
  std::vector<int> stack = {0};
  while (!stack.empty()) {
    const int segment = stack.back();
    stack.pop_back();
    order.push_back(segment);
    for (int s = skeleton.num_segments() - 1; s > 0; --s) {
      if (skeleton.segments[s].parent == segment) stack.push_back(s);
    }
  }
  return order;
}

std::string Indent(int depth) { return std::string(static_cast<size_t>(depth), '\t'); }

}  // namespace

int BvhMotion::FindJoint(const std::string& name) const {
  for (size_t i = 0; i < joints.size(); ++i) {
    if (joints[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

void BvhMotion::Validate() const {
  const auto fail = [](const std::string& fault) {
    throw Error(ErrorCode::kInvalidArgument, "BVH motion: " + fault);
  };
  size_t num_channels = 0;
  std::vector<int> open;  // the chain of joints from a root to the previous one
  for (size_t i = 0; i < joints.size(); ++i) {
    const BvhJoint& joint = joints[i];
    if (joint.parent < -1 || joint.parent >= static_cast<int>(i)) {
      fail(fmt::format("joint {} has parent {}", i, joint.parent));
    }
    while (!open.empty() && open.back() != joint.parent) open.pop_back();
    if (open.empty() && joint.parent >= 0) {
      fail(fmt::format("joint {} ({}) is not in depth-first order", i, joint.name));
    }
    open.push_back(static_cast<int>(i));
    if (!joint.offset.allFinite() || (joint.end_site && !joint.end_site->allFinite())) {
      fail(fmt::format("joint {} ({}) has an offset that is not finite", i, joint.name));
    }
    num_channels += joint.channels.size();
  }
  if (joints.empty()) fail("no joint");
  if (values.rows() != static_cast<long>(num_channels)) {
    fail(fmt::format("{} rows of values for {} channels", values.rows(), num_channels));
  }
  if (!values.allFinite()) fail("a value is not finite");
  if (!(frame_time_s > 0) || !std::isfinite(frame_time_s)) {
    fail(fmt::format("frame time {} s", frame_time_s));
  }
}

std::vector<Eigen::Isometry3d> BvhJointTransforms(const BvhMotion& motion, int frame) {
  if (frame < 0 || frame >= motion.num_frames()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("BVH frame {} of {}", frame, motion.num_frames()));
  }
  std::vector<Eigen::Isometry3d> world_from_joint;
  world_from_joint.reserve(motion.joints.size());
  int row = 0;
  for (const BvhJoint& joint : motion.joints) {
    Eigen::Vector3d position = joint.offset;
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    for (const BvhChannel channel : joint.channels) {
      const double value = motion.values(row++, frame);
      const int axis = static_cast<int>(channel) % 3;
      if (channel <= BvhChannel::kZPosition) {
        position[axis] = value;
      } else {
        rotation =
            rotation *
            Eigen::AngleAxisd(value * kDegree, Eigen::Vector3d::Unit(axis)).toRotationMatrix();
      }
    }
    Eigen::Isometry3d parent_from_joint = Eigen::Isometry3d::Identity();
    parent_from_joint.linear() = rotation;
    parent_from_joint.translation() = position;
    world_from_joint.push_back(
        joint.parent < 0 ? parent_from_joint
                         : world_from_joint[static_cast<size_t>(joint.parent)] * parent_from_joint);
  }
  return world_from_joint;
}

Eigen::Matrix3Xd BvhJointPositions(const BvhMotion& motion, int frame) {
  const std::vector<Eigen::Isometry3d> world_from_joint = BvhJointTransforms(motion, frame);
  Eigen::Matrix3Xd positions(3, world_from_joint.size());
  for (size_t i = 0; i < world_from_joint.size(); ++i) {
    positions.col(static_cast<int>(i)) = world_from_joint[i].translation();
  }
  return positions;
}

BvhJointPaths JointPathsOf(const BvhMotion& motion, int begin, int end) {
  BvhJointPaths paths;
  for (const BvhJoint& joint : motion.joints) {
    paths.names.push_back(joint.name);
    paths.parents.push_back(joint.parent);
  }
  const size_t num_joints = motion.joints.size();
  for (size_t j = 0; j < num_joints; ++j) {
    if (!motion.joints[j].end_site) continue;
    paths.names.push_back(motion.joints[j].name + "_end");
    paths.parents.push_back(static_cast<int>(j));
  }
  for (int f = begin; f < end; ++f) {
    const std::vector<Eigen::Isometry3d> world_from_joint = BvhJointTransforms(motion, f);
    Eigen::Matrix3Xd positions(3, static_cast<Eigen::Index>(paths.names.size()));
    auto site = static_cast<Eigen::Index>(num_joints);
    for (size_t j = 0; j < num_joints; ++j) {
      positions.col(static_cast<Eigen::Index>(j)) = world_from_joint[j].translation();
      if (motion.joints[j].end_site) {
        positions.col(site++) = world_from_joint[j] * *motion.joints[j].end_site;
      }
    }
    paths.positions.push_back(positions);
  }
  return paths;
}

void WriteBvh(const std::filesystem::path& path, const BvhMotion& motion) {
  motion.Validate();
  std::string text = "HIERARCHY\n";
  const int num_joints = static_cast<int>(motion.joints.size());
  std::vector<int> open;
  const auto close_to = [&](int parent) {
    while (!open.empty() && open.back() != parent) {
      open.pop_back();
      text += Indent(static_cast<int>(open.size())) + "}\n";
    }
  };
  for (int i = 0; i < num_joints; ++i) {
    const BvhJoint& joint = motion.joints[static_cast<size_t>(i)];
    close_to(joint.parent);
    const int depth = static_cast<int>(open.size());
    const auto offset_line = [&](int at, const Eigen::Vector3d& offset) {
      return fmt::format("{}OFFSET {:.7f} {:.7f} {:.7f}\n", Indent(at), offset.x(), offset.y(),
                         offset.z());
    };
    text += fmt::format("{}{} {}\n{}{{\n", Indent(depth), joint.parent < 0 ? "ROOT" : "JOINT",
                        joint.name, Indent(depth));
    text += offset_line(depth + 1, joint.offset);
    text += fmt::format("{}CHANNELS {}", Indent(depth + 1), joint.channels.size());
    for (const BvhChannel channel : joint.channels) {
      text += fmt::format(" {}", kChannelNames[static_cast<size_t>(channel)]);
    }
    text += "\n";
    if (joint.end_site) {
      text += fmt::format("{0}End Site\n{0}{{\n", Indent(depth + 1));
      text += offset_line(depth + 2, *joint.end_site) + Indent(depth + 1) + "}\n";
    }
    open.push_back(i);
  }
  close_to(-1);

  std::vector<int> decimals;  // per row of values
  for (const BvhJoint& joint : motion.joints) {
    for (const BvhChannel channel : joint.channels) {
      decimals.push_back(channel <= BvhChannel::kZPosition ? 7 : 6);
    }
  }
  text += fmt::format("MOTION\nFrames: {}\nFrame Time: {:.9f}\n", motion.num_frames(),
                      motion.frame_time_s);
  for (int f = 0; f < motion.num_frames(); ++f) {
    for (size_t c = 0; c < decimals.size(); ++c) {
      text += fmt::format("{}{:.{}f}", c ? " " : "", motion.values(static_cast<int>(c), f),
                          decimals[c]);
    }
    text += "\n";
  }
  WriteFileAtomically(path, text);
}

BvhMotion BvhFromPoses(const Skeleton& skeleton, const Eigen::MatrixXd& poses, double fps) {
  if (poses.rows() != skeleton.num_dofs() || poses.cols() < 1 || !poses.allFinite()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("poses are {} x {}, expected {} finite rows and a frame", poses.rows(),
                            poses.cols(), skeleton.num_dofs()));
  }
  if (!(fps > 0) || !std::isfinite(fps)) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("{} frames per second", fps));
  }
  KinematicState zero;
  ForwardKinematics(skeleton, ZeroPose(skeleton), &zero);
  const std::vector<int> order = DepthFirst(skeleton);
  std::vector<int> position_in_order(order.size());
  for (size_t i = 0; i < order.size(); ++i) position_in_order[order[i]] = static_cast<int>(i);

  BvhMotion motion;
  motion.frame_time_s = 1 / fps;
  int num_channels = 0;
  for (const int s : order) {
    const Segment& segment = skeleton.segments[s];
    BvhJoint joint;
    joint.name = segment.name;
    if (segment.parent < 0) {
      joint.channels.assign(kPositions.begin(), kPositions.end());
    } else {
      joint.parent = position_in_order[segment.parent];
      joint.offset = zero.origins.col(s) - zero.origins.col(segment.parent);
    }
    joint.channels.insert(joint.channels.end(), kRotations.begin(), kRotations.end());
    const bool is_leaf = std::none_of(order.begin(), order.end(), [&](int other) {
      return skeleton.segments[other].parent == s;
    });
    if (is_leaf) joint.end_site = zero.rotations[s] * SegmentEnd(skeleton, s);
    num_channels += static_cast<int>(joint.channels.size());
    motion.joints.push_back(std::move(joint));
  }

  motion.values.resize(num_channels, poses.cols());
  Eigen::Matrix3Xd angles = Eigen::Matrix3Xd::Zero(3, skeleton.num_segments());
  KinematicState state;
  for (int f = 0; f < poses.cols(); ++f) {
    ForwardKinematics(skeleton, poses.col(f), &state);
    int row = 0;
    for (const int s : order) {
      // The motion of the segment from the T-pose, relative to its parent's.
      Eigen::Matrix3d rotation = state.rotations[s] * zero.rotations[s].transpose();
      const int parent = skeleton.segments[s].parent;
      if (parent < 0) {
        motion.values.col(f).segment<3>(row) = state.origins.col(s);
        row += 3;
      } else {
        rotation = zero.rotations[parent] * state.rotations[parent].transpose() * rotation;
      }
      angles.col(s) = ContinuousZxy(rotation, angles.col(s));
      motion.values.col(f).segment<3>(row) = angles.col(s) / kDegree;
      row += 3;
    }
  }
  return motion;
}

}  // namespace mpc
