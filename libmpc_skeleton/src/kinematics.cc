#include "mpc/skeleton/kinematics.h"

#include <fmt/format.h>

#include <cmath>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"

namespace mpc {
namespace {

// Rotation about a unit axis (Rodrigues).
Eigen::Matrix3d AxisRotation(const Eigen::Vector3d& axis, double angle) {
  const double s = std::sin(angle);
  const double c = std::cos(angle);
  const Eigen::Vector3d t = (1 - c) * axis;
  Eigen::Matrix3d rotation;
  rotation << t.x() * axis.x() + c, t.x() * axis.y() - s * axis.z(),
      t.x() * axis.z() + s * axis.y(), t.x() * axis.y() + s * axis.z(), t.y() * axis.y() + c,
      t.y() * axis.z() - s * axis.x(), t.x() * axis.z() - s * axis.y(),
      t.y() * axis.z() + s * axis.x(), t.z() * axis.z() + c;
  return rotation;
}

// The columns of a point's Jacobian that are not zero, into 3 rows of a matrix that begin at `rows`.
void FillPointJacobian(const Skeleton& skeleton, const KinematicState& state, int segment,
                       const Eigen::Vector3d& x_in_body, double* rows, Eigen::Index stride) {
  const auto column = [&](Eigen::Index n) {
    return Eigen::Map<Eigen::Vector3d>(rows + n * stride);
  };
  const Eigen::Vector3d from_root = x_in_body - state.origins.col(0);
  for (int axis = 0; axis < 3; ++axis) {
    column(axis) = Eigen::Vector3d::Unit(axis);
    column(3 + axis) = Eigen::Vector3d::Unit(axis).cross(from_root);
  }
  for (int s = segment; s > 0; s = skeleton.segments[s].parent) {
    const Eigen::Vector3d lever = x_in_body - state.origins.col(s);
    for (int h = state.hinge_begin[s]; h < state.hinge_begin[s + 1]; ++h) {
      column(6 + h) = state.hinge_axes.col(h).cross(lever);
    }
  }
}

}  // namespace

void ForwardKinematics(const Skeleton& skeleton, const Eigen::VectorXd& pose,
                       KinematicState* state) {
  if (pose.size() != skeleton.num_dofs()) {
    throw Error(
        ErrorCode::kInvalidArgument,
        fmt::format("pose has {} numbers, the skeleton {} dofs", pose.size(), skeleton.num_dofs()));
  }
  ForwardKinematics(skeleton, pose, ExpSO3(pose.segment<3>(3)), state);
}

void ForwardKinematics(const Skeleton& skeleton, const Eigen::VectorXd& pose,
                       const Eigen::Matrix3d& root_rotation, KinematicState* state) {
  const int num_segments = skeleton.num_segments();
  const int num_hinges = static_cast<int>(skeleton.hinges.size());
  if (pose.size() != skeleton.num_dofs()) {
    throw Error(
        ErrorCode::kInvalidArgument,
        fmt::format("pose has {} numbers, the skeleton {} dofs", pose.size(), skeleton.num_dofs()));
  }
  state->rotations.resize(num_segments);
  state->origins.resize(3, num_segments);
  state->hinge_axes.resize(3, num_hinges);
  state->joints.resize(3, skeleton.num_joints());
  state->hinge_begin.resize(num_segments + 1);

  int h = 0;
  for (int s = 0; s < num_segments; ++s) {
    const Segment& segment = skeleton.segments[s];
    state->hinge_begin[s] = h;
    if (s == 0) {
      state->rotations[0] = root_rotation;
      state->origins.col(0) = pose.head<3>();
      continue;
    }
    const Eigen::Matrix3d& parent = state->rotations[segment.parent];
    state->origins.col(s) = state->origins.col(segment.parent) + parent * segment.offset;
    Eigen::Matrix3d rotation = parent * segment.rest_rotation;
    for (; h < num_hinges && skeleton.hinges[h].segment == s; ++h) {
      const Eigen::Vector3d& axis = skeleton.hinges[h].axis;
      state->hinge_axes.col(h) = rotation * axis;
      rotation = rotation * AxisRotation(axis, pose[6 + h]);
    }
    state->rotations[s] = rotation;
  }
  state->hinge_begin[num_segments] = h;
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const SkeletonJoint& joint = skeleton.joints[j];
    state->joints.col(j) =
        state->origins.col(joint.segment) + state->rotations[joint.segment] * joint.x_in_segment;
  }
}

void PointJacobian(const Skeleton& skeleton, const KinematicState& state, int segment,
                   const Eigen::Vector3d& x_in_body, Eigen::Ref<Eigen::MatrixXd> jacobian) {
  jacobian.setZero();
  FillPointJacobian(skeleton, state, segment, x_in_body, jacobian.data(), jacobian.outerStride());
}

void JointJacobian(const Skeleton& skeleton, const KinematicState& state,
                   Eigen::MatrixXd* jacobian) {
  const int num_joints = skeleton.num_joints();
  jacobian->setZero(3 * num_joints, skeleton.num_dofs());
  for (int j = 0; j < num_joints; ++j) {
    FillPointJacobian(skeleton, state, skeleton.joints[j].segment, state.joints.col(j),
                      jacobian->data() + 3 * j, jacobian->outerStride());
  }
}

Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> HingeInfluence(const Skeleton& skeleton) {
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> influence(skeleton.hinges.size(),
                                                               skeleton.num_segments());
  influence.setConstant(false);
  for (int s = 0; s < skeleton.num_segments(); ++s) {
    for (int a = s; a > 0; a = skeleton.segments[a].parent) {
      for (size_t h = 0; h < skeleton.hinges.size(); ++h) {
        if (skeleton.hinges[h].segment == a) influence(static_cast<int>(h), s) = true;
      }
    }
  }
  return influence;
}

Eigen::MatrixXd JointTrajectories(const Skeleton& skeleton, const Eigen::MatrixXd& poses) {
  Eigen::MatrixXd trajectories(3 * skeleton.num_joints(), poses.cols());
  KinematicState state;
  for (int f = 0; f < poses.cols(); ++f) {
    ForwardKinematics(skeleton, poses.col(f), &state);
    trajectories.col(f) = state.joints.reshaped();
  }
  return trajectories;
}

}  // namespace mpc
