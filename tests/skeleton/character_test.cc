#include "mpc/skeleton/character.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "mpc/core/rigid.h"
#include "mpc/skeleton/rig_pose.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Eigen::Vector3d;
using testing::MakeTestRig;
using testing::TestRigOptions;
using testing::TestRigVariants;

struct PartJoint {
  RigPart part;
  JointId joint;
};

const std::vector<PartJoint>& PartJoints() {
  static const std::vector<PartJoint> pairs = {{RigPart::kNeck, JointId::kNeck},
                                               {RigPart::kLeftUpperArm, JointId::kLeftShoulder},
                                               {RigPart::kLeftLowerArm, JointId::kLeftElbow},
                                               {RigPart::kLeftHand, JointId::kLeftWrist},
                                               {RigPart::kRightUpperArm, JointId::kRightShoulder},
                                               {RigPart::kRightLowerArm, JointId::kRightElbow},
                                               {RigPart::kRightHand, JointId::kRightWrist},
                                               {RigPart::kLeftUpperLeg, JointId::kLeftHip},
                                               {RigPart::kLeftLowerLeg, JointId::kLeftKnee},
                                               {RigPart::kLeftFoot, JointId::kLeftAnkle},
                                               {RigPart::kRightUpperLeg, JointId::kRightHip},
                                               {RigPart::kRightLowerLeg, JointId::kRightKnee},
                                               {RigPart::kRightFoot, JointId::kRightAnkle}};
  return pairs;
}

Character Build(const RigAsset& rig) { return BuildCharacter(rig, MapRigByNames(rig)); }

double Angle(const Character& character, const std::string& name) {
  for (size_t h = 0; h < character.skeleton.hinges.size(); ++h) {
    if (character.skeleton.hinges[h].name == name) return character.bind_pose[6 + h];
  }
  ADD_FAILURE() << "no hinge " << name;
  return 0;
}

Vector3d JointAtBind(const Character& character, JointId id) {
  return character.bind.joints.col(character.skeleton.FindJointIndex(id));
}

class CharacterOfEveryRig : public ::testing::TestWithParam<TestRigOptions> {};
INSTANTIATE_TEST_SUITE_P(Rigs, CharacterOfEveryRig, ::testing::ValuesIn(TestRigVariants()));

TEST_P(CharacterOfEveryRig, ReproducesBonePositionsAtBind) {
  const RigAsset rig = MakeTestRig(GetParam());
  const RigMap map = MapRigByNames(rig);
  const Character character = BuildCharacter(rig, map);
  character.skeleton.Validate();
  KinematicState state;
  ForwardKinematics(character.skeleton, character.bind_pose, &state);
  for (const PartJoint& pair : PartJoints()) {
    const Vector3d bone = rig.bones[map[pair.part]].scene_from_bone.translation();
    const Vector3d joint = state.joints.col(character.skeleton.FindJointIndex(pair.joint));
    EXPECT_LT((bone - joint).norm(), 1e-9) << RigPartName(pair.part);
  }
  const Vector3d spine = rig.bones[map[RigPart::kSpine]].scene_from_bone.translation();
  const Vector3d head = rig.bones[map[RigPart::kHead]].scene_from_bone.translation();
  EXPECT_LT((state.origins.col(kChestSegment) - spine).norm(), 1e-9);
  EXPECT_LT((state.origins.col(kHeadSegment) - head).norm(), 1e-9);
}

TEST_P(CharacterOfEveryRig, BindAnglesAreThoseOfTheModel) {
  const TestRigOptions& options = GetParam();
  const Character character = Build(MakeTestRig(options));
  for (const double sign : {1.0, -1.0}) {
    const std::string side = sign > 0 ? "left_" : "right_";
    // Mirrored hinges: the same motion has the same angle on both sides.
    EXPECT_NEAR(Angle(character, side + "shoulder_abduction"), -options.arm_down_rad, 1e-6);
    EXPECT_NEAR(Angle(character, side + "shoulder_flexion"), options.arm_forward_rad, 1e-6);
    EXPECT_NEAR(Angle(character, side + "shoulder_twist"), options.arm_twist_rad, 1e-6);
    EXPECT_NEAR(Angle(character, side + "elbow_flexion"), options.elbow_bend_rad, 1e-6);
    EXPECT_NEAR(Angle(character, side + "knee_flexion"), options.knee_bend_rad, 0.1);
  }
  EXPECT_LT((ExpSO3(character.bind_pose.segment<3>(3)) -
             Eigen::AngleAxisd(options.yaw_rad, Vector3d::UnitY()).toRotationMatrix())
                .norm(),
            1e-9);
}

// Whatever the rig's own pose, zero angles are a T-pose that faces +z.
TEST_P(CharacterOfEveryRig, ZeroPoseIsATPose) {
  const Character character = Build(MakeTestRig(GetParam()));
  KinematicState state;
  ForwardKinematics(character.skeleton, ZeroPose(character.skeleton), &state);
  const auto direction = [&](JointId from, JointId to) -> Vector3d {
    return (state.joints.col(character.skeleton.FindJointIndex(to)) -
            state.joints.col(character.skeleton.FindJointIndex(from)))
        .normalized();
  };
  using enum JointId;
  constexpr double kCos = 0.999;
  EXPECT_GT(direction(kLeftShoulder, kLeftElbow).x(), kCos);
  EXPECT_GT(direction(kLeftElbow, kLeftWrist).x(), kCos);
  EXPECT_LT(direction(kRightShoulder, kRightElbow).x(), -kCos);
  EXPECT_LT(direction(kRightElbow, kRightWrist).x(), -kCos);
  for (const auto& [hip, knee, ankle, toe] :
       {std::array{kLeftHip, kLeftKnee, kLeftAnkle, kLeftToe},
        std::array{kRightHip, kRightKnee, kRightAnkle, kRightToe}}) {
    EXPECT_LT(direction(hip, knee).y(), -kCos);
    EXPECT_LT(direction(knee, ankle).y(), -kCos);
    EXPECT_GT(direction(ankle, toe).z(), 0.9);
  }
  EXPECT_GT(direction(kNeck, kHeadTop).y(), 0.95);
}

TEST(Character, BentElbowsHingeInThePlaneOfTheBend) {
  const Character character = Build(MakeTestRig({.arm_down_rad = 0.8, .elbow_bend_rad = 0.7}));
  const Vector3d upper =
      JointAtBind(character, JointId::kLeftElbow) - JointAtBind(character, JointId::kLeftShoulder);
  const Vector3d lower =
      JointAtBind(character, JointId::kLeftWrist) - JointAtBind(character, JointId::kLeftElbow);
  const int elbow = character.bind.hinge_begin[kLeftForearmSegment];
  EXPECT_GT(character.bind.hinge_axes.col(elbow).dot(upper.cross(lower).normalized()), 1 - 1e-9);
  EXPECT_LT(
      (character.skeleton.segments[kLeftForearmSegment].rest_rotation - Eigen::Matrix3d::Identity())
          .norm(),
      1e-9);
}

TEST_P(CharacterOfEveryRig, MeshJointsLieOnTheMesh) {
  const TestRigOptions& options = GetParam();
  const Character character = Build(MakeTestRig(options));
  const Eigen::Matrix3d unturn =
      Eigen::AngleAxisd(-options.yaw_rad, Vector3d::UnitY()).toRotationMatrix();
  const auto at = [&](JointId id) -> Vector3d { return unturn * JointAtBind(character, id); };
  EXPECT_NEAR(at(JointId::kHeadTop).y(), 1.78, 1e-3);
  EXPECT_NEAR(at(JointId::kHeadTop).x(), 0, 1e-9);
  const Vector3d ankle = at(JointId::kLeftAnkle);
  const Vector3d toe = at(JointId::kLeftToe);
  EXPECT_NEAR(toe.z() - ankle.z(), 0.2, 1e-3);
  EXPECT_LT(toe.x(), at(JointId::kLeftSmallToe).x());
  EXPECT_GT(at(JointId::kRightToe).x(), at(JointId::kRightSmallToe).x());
  EXPECT_NEAR(at(JointId::kRightHeel).z() - at(JointId::kRightAnkle).z(), -0.06, 1e-3);
  EXPECT_GT(at(JointId::kNose).z(), 0.05);
  EXPECT_GT(at(JointId::kLeftEar).x(), 0.03);
  EXPECT_LT(at(JointId::kRightEye).x(), -0.01);
  EXPECT_LT((at(JointId::kPelvis) - (at(JointId::kLeftHip) + at(JointId::kRightHip)) / 2).norm(),
            1e-9);
}

TEST_P(CharacterOfEveryRig, WeightsArePerSegmentSortedAndSumToOne) {
  const RigAsset rig = MakeTestRig(GetParam());
  const Character character = Build(rig);
  ASSERT_EQ(character.weights.cols(), rig.num_vertices());
  EXPECT_EQ(character.mesh.triangles.cols(), rig.meshes[0].mesh.triangles.cols());
  for (Eigen::Index v = 0; v < character.weights.cols(); ++v) {
    EXPECT_NEAR(character.weights.col(v).sum(), 1, 1e-6);
    for (Eigen::Index k = 1; k < character.weights.rows(); ++k) {
      EXPECT_GE(character.weights(k - 1, v), character.weights(k, v));
    }
  }
  EXPECT_GE(character.weights.minCoeff(), 0);
  EXPECT_LT(character.segments.maxCoeff(), kNumDefaultSegments);
}

TEST(Character, BonesFollowTheSegmentsOfTheirAncestors) {
  const RigAsset rig = MakeTestRig();
  const Character character = Build(rig);
  const auto segment = [&](const char* bone) { return character.bone_segment[rig.FindBone(bone)]; };
  EXPECT_EQ(segment("hips"), kPelvisSegment);
  EXPECT_EQ(segment("spine"), kChestSegment);
  EXPECT_EQ(segment("chest"), kChestSegment);
  EXPECT_EQ(segment("leftShoulder"), kChestSegment);
  EXPECT_EQ(segment("neck"), kNeckSegment);
  EXPECT_EQ(segment("head"), kHeadSegment);
  EXPECT_EQ(segment("leftHand"), kLeftForearmSegment);
  EXPECT_EQ(segment("leftIndex"), kLeftForearmSegment);
  EXPECT_EQ(segment("rightUpperArm"), kRightUpperArmSegment);
  EXPECT_EQ(segment("rightToes"), kRightFootSegment);
}

TEST(Character, SpineBonesBelowThePivotStayWithThePelvis) {
  RigAsset rig = MakeTestRig();
  // The chest bone is now nearer to a third of the way from the hips to the neck.
  rig.bones[rig.FindBone("spine")].scene_from_bone.translation().y() = 1.00;
  rig.bones[rig.FindBone("chest")].scene_from_bone.translation().y() = 1.15;
  const Character character = Build(rig);
  EXPECT_EQ(character.bone_segment[rig.FindBone("spine")], kPelvisSegment);
  EXPECT_EQ(character.bone_segment[rig.FindBone("chest")], kChestSegment);
  EXPECT_NEAR(character.bind.origins(1, kChestSegment), 1.15, 1e-12);
}

TEST(Character, WorksWithoutTheOptionalBones) {
  RigAsset rig = MakeTestRig();
  for (const char* name : {"spine", "chest", "neck", "head", "leftToes", "rightToes"}) {
    rig.bones[rig.FindBone(name)].name = std::string("bone") + name + "x";
  }
  const RigMap map = MapRigByNames(rig);
  EXPECT_EQ(map[RigPart::kNeck], -1);
  EXPECT_GE(map.notes.size(), 6u);
  const Character character = BuildCharacter(rig, map);
  EXPECT_NEAR(JointAtBind(character, JointId::kNeck).y(), 1.48, 0.05);
  EXPECT_NEAR(JointAtBind(character, JointId::kHeadTop).y(), 1.75, 0.15);
  EXPECT_NEAR(JointAtBind(character, JointId::kLeftToe).z(), 0.18, 0.02);
}

TEST(Character, VertexWithoutWeightsFollowsTheNearestBone) {
  RigAsset rig = MakeTestRig();
  RigMesh& mesh = rig.meshes[0];
  const Vector3d knee = rig.bones[rig.FindBone("rightLowerLeg")].scene_from_bone.translation();
  mesh.mesh.positions.col(7) = knee.cast<float>();
  mesh.weights.col(7).setZero();
  const Character character = Build(rig);
  EXPECT_EQ(character.segments(0, 7), kRightShankSegment);
  EXPECT_EQ(character.weights(0, 7), 1);
}

TEST(Character, SeveralPrimitivesBecomeOneMesh) {
  RigAsset rig = MakeTestRig();
  rig.meshes.push_back(rig.meshes[0]);
  const Character character = Build(rig);
  const Eigen::Index vertices = rig.meshes[0].mesh.positions.cols();
  const Eigen::Index triangles = rig.meshes[0].mesh.triangles.cols();
  character.mesh.Validate();
  EXPECT_EQ(character.mesh.positions.cols(), 2 * vertices);
  EXPECT_EQ(character.mesh.triangles(2, triangles), vertices + character.mesh.triangles(2, 0));
  EXPECT_EQ(character.weights.leftCols(vertices), character.weights.rightCols(vertices));
}

TEST(Character, CoincidingPartsAreRefused) {
  RigAsset rig = MakeTestRig();
  rig.bones[rig.FindBone("leftLowerLeg")].scene_from_bone =
      rig.bones[rig.FindBone("leftUpperLeg")].scene_from_bone;
  EXPECT_MPC_ERROR(Build(rig), kUnsupported, "left_upper_leg has no length");
}

TEST(Character, SidesThatCoincideAreRefused) {
  RigAsset rig = MakeTestRig();
  for (const char* name : {"UpperLeg", "LowerLeg", "Foot"}) {
    rig.bones[rig.FindBone(std::string("left") + name)].scene_from_bone =
        rig.bones[rig.FindBone(std::string("right") + name)].scene_from_bone;
  }
  EXPECT_MPC_ERROR(Build(rig), kUnsupported, "left and right cannot be told apart");
}

TEST(Character, AMapOfAnotherRigIsRefused) {
  const RigAsset rig = MakeTestRig();
  RigMap map = MapRigByNames(rig);
  map[RigPart::kHips] = 1000;
  EXPECT_MPC_ERROR(BuildCharacter(rig, map), kMismatch, "hips is bone 1000");
  map[RigPart::kHips] = -1;
  EXPECT_MPC_ERROR(BuildCharacter(rig, map), kUnsupported, "no bone for hips");
}

TEST_P(CharacterOfEveryRig, RigBonesCarryTheMeshLikeTheSegments) {
  const RigAsset rig = MakeTestRig(GetParam());
  const Character character = Build(rig);
  Eigen::VectorXd pose = character.bind_pose;
  std::mt19937 rng(5);
  std::normal_distribution<double> normal(0, 0.3);
  for (double& x : pose) x += normal(rng);
  KinematicState state;
  ForwardKinematics(character.skeleton, pose, &state);
  std::vector<Eigen::Affine3d> body_from_bone;
  RigBoneTransforms(rig, character, state, &body_from_bone);
  // Linear blending by bones against linear blending by segments, both in double.
  const RigMesh& mesh = rig.meshes[0];
  for (Eigen::Index v = 0; v < mesh.mesh.positions.cols(); ++v) {
    const Vector3d x = mesh.mesh.positions.col(v).cast<double>();
    Vector3d by_bones = Vector3d::Zero();
    for (int k = 0; k < 2; ++k) {
      const int b = mesh.bones(k, v);
      by_bones +=
          mesh.weights(k, v) * (body_from_bone[b] * (rig.bones[b].scene_from_bone.inverse() * x));
    }
    Vector3d by_segments = Vector3d::Zero();
    for (Eigen::Index k = 0; k < character.weights.rows(); ++k) {
      const int s = character.segments(k, v);
      const Eigen::Matrix3d turn = state.rotations[s] * character.bind.rotations[s].transpose();
      by_segments += character.weights(k, v) *
                     (turn * (x - character.bind.origins.col(s)) + state.origins.col(s));
    }
    EXPECT_LT((by_bones - by_segments).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace mpc
