#include "mpc/skeleton/limbs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "mpc/skeleton/skinning.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

class LimbsTest : public ::testing::Test {
 protected:
  const Limb* Find(int segment) const {
    for (const Limb& limb : limbs_) {
      if (limb.segment == segment) return &limb;
    }
    return nullptr;
  }

  RigAsset rig_ = testing::MakeTestRig({.arm_down_rad = 0.8, .yaw_rad = 0.5});
  Character character_ = BuildCharacter(rig_, MapRigByNames(rig_));
  std::vector<Limb> limbs_ = FindLimbs(character_);
};

TEST_F(LimbsTest, EverySegmentHasOne) {
  std::set<int> segments;
  for (const Limb& limb : limbs_) segments.insert(limb.segment);
  EXPECT_EQ(static_cast<int>(segments.size()), character_.skeleton.num_segments());
}

// The rig's limbs are boxes: all their vertices have the same distance from the bone.
TEST_F(LimbsTest, RadiusIsTheMeshs) {
  const Limb* thigh = Find(kLeftThighSegment);
  ASSERT_NE(thigh, nullptr);
  double nearest = 1e9, farthest = 0;
  const Eigen::Vector3d bone = thigh->end_in_segment.normalized();
  for (Eigen::Index v = 0; v < character_.mesh.positions.cols(); ++v) {
    Eigen::Index heaviest = 0;
    character_.weights.col(v).maxCoeff(&heaviest);
    if (character_.segments(heaviest, v) != kLeftThighSegment) continue;
    const Eigen::Vector3d x = character_.bind.rotations[kLeftThighSegment].transpose() *
                              (character_.mesh.positions.col(v).cast<double>() -
                               character_.bind.origins.col(kLeftThighSegment));
    const double distance = (x - x.dot(bone) * bone).norm();
    nearest = std::min(nearest, distance);
    farthest = std::max(farthest, distance);
  }
  EXPECT_GE(thigh->radius, nearest - 1e-9);
  EXPECT_LE(thigh->radius, farthest + 1e-9);
  EXPECT_GT(thigh->radius, 0.02);
}

TEST_F(LimbsTest, LeftAndRightAreAlike) {
  const Limb* left = Find(kLeftShankSegment);
  const Limb* right = Find(kRightShankSegment);
  EXPECT_NEAR(left->radius, right->radius, 1e-6);
  EXPECT_NEAR(left->end_in_segment.norm(), right->end_in_segment.norm(), 1e-6);
}

TEST_F(LimbsTest, CapsulesEndAtTheJoints) {
  Eigen::VectorXd pose = character_.bind_pose;
  pose.head<6>() << 0.3, -0.2, 4, 0.4, 2, -0.3;
  pose.tail(pose.size() - 6).array() += 0.2;
  KinematicState state;
  ForwardKinematics(character_.skeleton, pose, &state);
  const CapsuleSet capsules = PoseLimbs(limbs_, state);
  ASSERT_EQ(capsules.size(), limbs_.size());
  const auto joint = [&](JointId id) -> Eigen::Vector3d {
    return state.joints.col(character_.skeleton.FindJointIndex(id));
  };
  for (size_t i = 0; i < limbs_.size(); ++i) {
    EXPECT_LT((capsules[i].a - state.origins.col(limbs_[i].segment)).norm(), 1e-12);
    if (limbs_[i].segment == kLeftForearmSegment) {
      EXPECT_LT((capsules[i].b - joint(JointId::kLeftWrist)).norm(), 1e-9);
    }
    if (limbs_[i].segment == kRightShankSegment) {
      EXPECT_LT((capsules[i].b - joint(JointId::kRightAnkle)).norm(), 1e-9);
    }
  }
}

// A character twice as large has limbs twice as thick.
TEST_F(LimbsTest, RadiiScaleWithTheMesh) {
  RigAsset large = rig_;
  for (RigBone& bone : large.bones) {
    bone.scene_from_bone = Eigen::Scaling(2.0) * bone.scene_from_bone;
  }
  for (RigMesh& mesh : large.meshes) mesh.mesh.positions *= 2;
  const std::vector<Limb> limbs = FindLimbs(BuildCharacter(large, MapRigByNames(large)));
  ASSERT_EQ(limbs.size(), limbs_.size());
  for (size_t i = 0; i < limbs.size(); ++i) {
    EXPECT_NEAR(limbs[i].radius, 2 * limbs_[i].radius, 1e-5);
  }
}

}  // namespace
}  // namespace mpc
