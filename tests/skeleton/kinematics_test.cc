#include "mpc/skeleton/kinematics.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "mpc/core/rigid.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

class Kinematics : public ::testing::Test {
 protected:
  VectorXd RandomPose() {
    VectorXd pose(skeleton_.num_dofs());
    std::normal_distribution<double> normal(0, 0.8);
    for (double& x : pose) x = normal(rng_);
    return pose;
  }
  KinematicState State(const VectorXd& pose) const {
    KinematicState state;
    ForwardKinematics(skeleton_, pose, &state);
    return state;
  }
  Vector3d Joint(const KinematicState& state, JointId id) const {
    return state.joints.col(skeleton_.FindJointIndex(id));
  }
  int Dof(const std::string& hinge) const {
    for (size_t h = 0; h < skeleton_.hinges.size(); ++h) {
      if (skeleton_.hinges[h].name == hinge) return 6 + static_cast<int>(h);
    }
    ADD_FAILURE() << "no hinge " << hinge;
    return 0;
  }

  std::mt19937 rng_{23};
  Skeleton skeleton_ = DefaultSkeleton();
};

TEST_F(Kinematics, SegmentsAreRigidAndConnectedInEveryPose) {
  const KinematicState rest = State(ZeroPose(skeleton_));
  for (int trial = 0; trial < 20; ++trial) {
    const KinematicState state = State(RandomPose());
    for (int s = 0; s < skeleton_.num_segments(); ++s) {
      const Eigen::Matrix3d& rotation = state.rotations[s];
      EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
      EXPECT_GT(rotation.determinant(), 0);
      const int parent = skeleton_.segments[s].parent;
      if (parent < 0) continue;
      EXPECT_NEAR((state.origins.col(s) - state.origins.col(parent)).norm(),
                  (rest.origins.col(s) - rest.origins.col(parent)).norm(), 1e-12);
    }
  }
}

TEST_F(Kinematics, CommutesWithAGlobalMotion) {
  const VectorXd pose = RandomPose();
  const KinematicState state = State(pose);
  const Eigen::Matrix3d turn = ExpSO3({0.4, -1.1, 0.9});
  const Vector3d shift(1, 2, 3);
  VectorXd moved = pose;
  moved.head<3>() = turn * pose.head<3>() + shift;
  moved.segment<3>(3) = LogSO3(turn * ExpSO3(pose.segment<3>(3)));
  EXPECT_LT((State(moved).joints - ((turn * state.joints).colwise() + shift)).norm(), 1e-12);
}

TEST_F(Kinematics, RootRotationMatrixAndVectorAgree) {
  VectorXd pose = RandomPose();
  const KinematicState by_vector = State(pose);
  const Eigen::Matrix3d rotation = ExpSO3(pose.segment<3>(3));
  pose.segment<3>(3).setConstant(99);
  KinematicState by_matrix;
  ForwardKinematics(skeleton_, pose, rotation, &by_matrix);
  EXPECT_EQ(by_vector.joints, by_matrix.joints);
}

// The signs of the hinges, as an anatomist names them.
TEST_F(Kinematics, PositiveAnglesFlex) {
  const auto move = [&](const std::string& hinge, JointId joint) {
    VectorXd pose = ZeroPose(skeleton_);
    pose[Dof(hinge)] = 0.5;
    return Vector3d(Joint(State(pose), joint) - Joint(State(ZeroPose(skeleton_)), joint));
  };
  for (const bool left : {true, false}) {
    const std::string side = left ? "left_" : "right_";
    const auto id = [left](JointId joint) { return left ? joint : MirrorJoint(joint); };
    const double out = left ? 1 : -1;
    EXPECT_GT(move(side + "elbow_flexion", id(JointId::kLeftWrist)).z(), 0.1) << "forearm forward";
    EXPECT_LT(move(side + "knee_flexion", id(JointId::kLeftAnkle)).z(), -0.1) << "shank backward";
    EXPECT_GT(move(side + "hip_flexion", id(JointId::kLeftKnee)).z(), 0.1) << "thigh forward";
    EXPECT_GT(out * move(side + "hip_abduction", id(JointId::kLeftKnee)).x(), 0.1);
    EXPECT_GT(move(side + "ankle_flexion", id(JointId::kLeftToe)).y(), 0.05) << "toes up";
    EXPECT_GT(move(side + "shoulder_abduction", id(JointId::kLeftElbow)).y(), 0.1) << "arm up";
    EXPECT_GT(move(side + "shoulder_flexion", id(JointId::kLeftElbow)).z(), 0.1) << "arm forward";
  }
  EXPECT_GT(move("spine_flexion", JointId::kNeck).z(), 0.1) << "bow";
  EXPECT_GT(move("neck_flexion", JointId::kHeadTop).z(), 0.05);
}

TEST_F(Kinematics, MirroredPosesMakeMirroredBodies) {
  VectorXd pose = ZeroPose(skeleton_);
  VectorXd mirrored = pose;
  std::normal_distribution<double> normal(0, 0.5);
  for (const Hinge& hinge : skeleton_.hinges) {
    if (!hinge.name.starts_with("left_")) continue;
    const std::string right = "right_" + hinge.name.substr(5);
    pose[Dof(hinge.name)] = mirrored[Dof(right)] = normal(rng_);
    pose[Dof(right)] = mirrored[Dof(hinge.name)] = normal(rng_);
  }
  const KinematicState state = State(pose);
  const KinematicState twin = State(mirrored);
  for (const SkeletonJoint& joint : skeleton_.joints) {
    const Vector3d x = Joint(state, joint.id);
    const Vector3d y = Joint(twin, MirrorJoint(joint.id));
    EXPECT_LT((x - Vector3d(-y.x(), y.y(), y.z())).norm(), 1e-12) << JointName(joint.id);
  }
}

TEST_F(Kinematics, HingeInfluenceSaysWhatAHingeMoves) {
  const auto influence = HingeInfluence(skeleton_);
  const VectorXd pose = RandomPose();
  const KinematicState state = State(pose);
  for (size_t h = 0; h < skeleton_.hinges.size(); ++h) {
    VectorXd moved = pose;
    moved[6 + h] += 0.1;
    const KinematicState after = State(moved);
    for (int s = 0; s < skeleton_.num_segments(); ++s) {
      const bool changed = (after.rotations[s] - state.rotations[s]).norm() > 1e-9;
      EXPECT_EQ(changed, influence(h, s)) << skeleton_.hinges[h].name << " " << s;
    }
  }
}

TEST_F(Kinematics, TrajectoriesStackTheJoints) {
  MatrixXd poses(skeleton_.num_dofs(), 3);
  for (int f = 0; f < 3; ++f) poses.col(f) = RandomPose();
  const MatrixXd trajectories = JointTrajectories(skeleton_, poses);
  for (int f = 0; f < 3; ++f) {
    EXPECT_EQ(trajectories.col(f), VectorXd(State(poses.col(f)).joints.reshaped()));
  }
}

TEST_F(Kinematics, APoseOfAnotherSizeIsRefused) {
  KinematicState state;
  EXPECT_MPC_ERROR(ForwardKinematics(skeleton_, VectorXd::Zero(7), &state), kInvalidArgument,
                   "7 numbers");
}

TEST(DefaultSkeleton, IsThePapers) {
  const Skeleton skeleton = DefaultSkeleton(1.8);
  EXPECT_NO_THROW(skeleton.Validate());
  EXPECT_EQ(skeleton.num_dofs(), 33);
  ASSERT_GE(skeleton.num_joints(), kNumPaperJoints);
  for (int j = 0; j < kNumPaperJoints; ++j) {
    EXPECT_EQ(skeleton.joints[j].id, static_cast<JointId>(j));
  }
  EXPECT_TRUE((skeleton.LowerBounds().array() <= 0).all());
  EXPECT_TRUE((skeleton.UpperBounds().array() >= 0).all());
  KinematicState state;
  ForwardKinematics(skeleton, ZeroPose(skeleton), &state);
  const double tall = state.joints(1, skeleton.FindJointIndex(JointId::kHeadTop)) -
                      state.joints(1, skeleton.FindJointIndex(JointId::kLeftHeel));
  EXPECT_NEAR(tall, 1.8, 0.03);
}

TEST(SkeletonValidate, NamesEveryFault) {
  Skeleton skeleton = DefaultSkeleton();
  skeleton.segments[3].parent = 7;
  skeleton.hinges[2].axis *= 2;
  skeleton.hinges[4].min_rad = 3;
  skeleton.joints[5].segment = 99;
  EXPECT_MPC_ERROR(skeleton.Validate(), kInvalidArgument, "segment 3 has parent 7");
  EXPECT_MPC_ERROR(skeleton.Validate(), kInvalidArgument, "hinge 2 has an axis of length 2");
  EXPECT_MPC_ERROR(skeleton.Validate(), kInvalidArgument, "hinge 4 has bounds");
  EXPECT_MPC_ERROR(skeleton.Validate(), kInvalidArgument, "right_elbow is on segment 99");
}

}  // namespace
}  // namespace mpc
