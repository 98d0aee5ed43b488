#include "mpc/skeleton/proportions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "mpc/skeleton/rig_pose.h"
#include "mpc/skeleton/skinning.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Eigen::Vector3d;
using enum JointId;

class ProportionsTest : public ::testing::Test {
 protected:
  double Distance(JointId a, JointId b) const {
    return (character_.bind.joints.col(character_.skeleton.FindJointIndex(a)) -
            character_.bind.joints.col(character_.skeleton.FindJointIndex(b)))
        .norm();
  }
  double& Scale(BodyPart part) { return proportions_.part[static_cast<size_t>(part)]; }
  void ScaleEverythingDifferently() {
    proportions_.overall = 1.1;
    for (int p = 0; p < kNumBodyParts; ++p) proportions_.part[p] = 0.85 + 0.04 * p;
  }

  RigAsset rig_ = testing::MakeTestRig({.arm_down_rad = 0.8, .yaw_rad = 0.5});
  Character character_ = BuildCharacter(rig_, MapRigByNames(rig_));
  Proportions proportions_;
};

TEST_F(ProportionsTest, OnesChangeNothing) {
  const Character before = character_;
  const RigAsset rig_before = rig_;
  ApplyProportions(proportions_, &character_, &rig_);
  EXPECT_LT((character_.mesh.positions - before.mesh.positions).cwiseAbs().maxCoeff(), 1e-6f);
  EXPECT_LT((character_.bind.joints - before.bind.joints).norm(), 1e-6);
  for (size_t b = 0; b < rig_.bones.size(); ++b) {
    EXPECT_TRUE(rig_.bones[b].scene_from_bone.isApprox(rig_before.bones[b].scene_from_bone, 1e-6));
  }
}

TEST_F(ProportionsTest, OverallScalesEveryDistanceAndStandsOnTheFloor) {
  const Character before = character_;
  const float floor = before.mesh.positions.row(1).minCoeff();
  proportions_.overall = 1.25;
  ApplyProportions(proportions_, &character_, &rig_);
  EXPECT_NEAR(character_.mesh.positions.row(1).minCoeff(), floor, 1e-6);
  const Eigen::Matrix3Xf lengths_before =
      before.mesh.positions.colwise() - before.mesh.positions.col(0).eval();
  const Eigen::Matrix3Xf lengths =
      character_.mesh.positions.colwise() - character_.mesh.positions.col(0).eval();
  EXPECT_LT((lengths - 1.25f * lengths_before).cwiseAbs().maxCoeff(), 1e-5f);
  EXPECT_EQ(rig_.meshes[0].mesh.positions, character_.mesh.positions);
}

TEST_F(ProportionsTest, EachPartScalesItsOwnLengthOnBothSides) {
  struct Case {
    BodyPart part;
    JointId a, b;
  };
  for (const Case& c :
       {Case{BodyPart::kUpperArm, kLeftShoulder, kLeftElbow},
        Case{BodyPart::kForearm, kLeftElbow, kLeftWrist},
        Case{BodyPart::kThigh, kLeftHip, kLeftKnee}, Case{BodyPart::kShank, kLeftKnee, kLeftAnkle},
        Case{BodyPart::kFoot, kLeftAnkle, kLeftToe}}) {
    const Character original = character_;
    const RigAsset original_rig = rig_;
    const double left = Distance(c.a, c.b);
    const double right = Distance(MirrorJoint(c.a), MirrorJoint(c.b));
    proportions_ = Proportions();
    Scale(c.part) = 1.2;
    ApplyProportions(proportions_, &character_, &rig_);
    EXPECT_NEAR(Distance(c.a, c.b), 1.2 * left, 1e-9) << BodyPartName(c.part);
    EXPECT_NEAR(Distance(MirrorJoint(c.a), MirrorJoint(c.b)), 1.2 * right, 1e-9);
    character_ = original;
    rig_ = original_rig;
  }
  const double hips = Distance(kLeftHip, kRightHip);
  const double shoulders = Distance(kLeftShoulder, kRightShoulder);
  const double upper_arm = Distance(kLeftShoulder, kLeftElbow);
  proportions_ = Proportions();
  Scale(BodyPart::kHips) = 0.9;
  Scale(BodyPart::kShoulders) = 1.1;
  ApplyProportions(proportions_, &character_, &rig_);
  EXPECT_NEAR(Distance(kLeftHip, kRightHip), 0.9 * hips, 1e-9);
  EXPECT_NEAR(Distance(kLeftShoulder, kRightShoulder), 1.1 * shoulders, 1e-9);
  EXPECT_NEAR(Distance(kLeftShoulder, kLeftElbow), upper_arm, 1e-9);
}

TEST_F(ProportionsTest, ScaledSkeletonIsTheCharactersSkeleton) {
  ScaleEverythingDifferently();
  const Skeleton scaled = ScaledSkeleton(character_.skeleton, proportions_);
  ApplyProportions(proportions_, &character_, &rig_);
  for (int s = 0; s < scaled.num_segments(); ++s) {
    EXPECT_EQ(scaled.segments[s].offset, character_.skeleton.segments[s].offset);
  }
}

// The same body whether the scaled rig is mapped anew or the character was scaled along.
TEST_F(ProportionsTest, BonesStayOnTheJoints) {
  ScaleEverythingDifferently();
  ApplyProportions(proportions_, &character_, &rig_);
  const RigMap map = MapRigByNames(rig_);
  const auto bone = [&](RigPart part) -> Vector3d {
    return rig_.bones[map[part]].scene_from_bone.translation();
  };
  const auto joint = [&](JointId id) -> Vector3d {
    return character_.bind.joints.col(character_.skeleton.FindJointIndex(id));
  };
  EXPECT_LT((bone(RigPart::kLeftHand) - joint(kLeftWrist)).norm(), 1e-9);
  EXPECT_LT((bone(RigPart::kRightFoot) - joint(kRightAnkle)).norm(), 1e-9);
  EXPECT_LT((bone(RigPart::kLeftUpperArm) - joint(kLeftShoulder)).norm(), 1e-9);
  EXPECT_LT((bone(RigPart::kNeck) - joint(kNeck)).norm(), 1e-9);
}

TEST_F(ProportionsTest, CharacterAndRigSkinToTheSameMesh) {
  ScaleEverythingDifferently();
  ApplyProportions(proportions_, &character_, &rig_);
  Eigen::VectorXd pose = character_.bind_pose;
  std::mt19937 rng(2);
  std::normal_distribution<double> normal(0, 0.3);
  for (double& x : pose) x += normal(rng);
  KinematicState state;
  ForwardKinematics(character_.skeleton, pose, &state);
  std::vector<DualQuaternion> motions;
  SegmentMotions(character_.bind, state, &motions);
  Eigen::Matrix3Xf linear(3, character_.mesh.positions.cols());
  SkinLinearBlend(character_.mesh.positions, character_.segments, character_.weights, motions,
                  &linear);
  std::vector<Eigen::Affine3d> body_from_bone;
  RigBoneTransforms(rig_, character_, state, &body_from_bone);
  const RigMesh& mesh = rig_.meshes[0];
  for (Eigen::Index v = 0; v < mesh.mesh.positions.cols(); ++v) {
    Vector3d x = Vector3d::Zero();
    for (int k = 0; k < 2; ++k) {
      const int b = mesh.bones(k, v);
      x += mesh.weights(k, v) * (body_from_bone[b] * rig_.bones[b].scene_from_bone.inverse() *
                                 mesh.mesh.positions.col(v).cast<double>());
    }
    EXPECT_LT((x - linear.col(v).cast<double>()).norm(), 5e-6);
  }
}

TEST_F(ProportionsTest, AbsurdScalesAreRefused) {
  for (const double scale : {0.0, -1.0, 0.1, 6.0, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
    proportions_ = Proportions();
    proportions_.overall = scale;
    EXPECT_MPC_ERROR(ApplyProportions(proportions_, &character_, &rig_), kInvalidArgument,
                     "the whole body");
    proportions_ = Proportions();
    Scale(BodyPart::kShank) = scale;
    EXPECT_MPC_ERROR(ScaledSkeleton(character_.skeleton, proportions_), kInvalidArgument, "shank");
  }
}

TEST_F(ProportionsTest, ARigOfAnotherCharacterIsRefused) {
  rig_.bones.pop_back();
  EXPECT_MPC_ERROR(ApplyProportions(proportions_, &character_, &rig_), kMismatch, "20");
}

TEST_F(ProportionsTest, AnyHeightIsReachedInOneCall) {
  const Character before = character_;
  const double height = ActorHeight(before);
  for (const double factor : {0.01, 1.0, 1.07, 60.0}) {
    Character scaled = before;
    RigAsset rig = rig_;
    EXPECT_NEAR(ScaleToHeight(factor * height, &scaled, &rig), factor, 1e-12);
    EXPECT_NEAR(ActorHeight(scaled), factor * height, 1e-5 * factor);
  }
  EXPECT_MPC_ERROR(ScaleToHeight(0, &character_, &rig_), kInvalidArgument, "scaled");
}

}  // namespace
}  // namespace mpc
