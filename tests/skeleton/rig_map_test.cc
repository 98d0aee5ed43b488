#include "mpc/skeleton/rig_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MakeTestRig;
using testing::TestBoneNames;

struct NamedRig {
  std::string convention;
  std::vector<std::string> names;  // in RigPart order
};

const std::vector<NamedRig>& NamedRigs() {
  static const std::vector<NamedRig> rigs = {
      {"Mixamo or Ready Player Me",
       {"mixamorig:Hips", "mixamorig:Spine", "mixamorig:Spine2", "mixamorig:Neck", "mixamorig:Head",
        "mixamorig:LeftArm", "mixamorig:LeftForeArm", "mixamorig:LeftHand", "mixamorig:RightArm",
        "mixamorig:RightForeArm", "mixamorig:RightHand", "mixamorig:LeftUpLeg", "mixamorig:LeftLeg",
        "mixamorig:LeftFoot", "mixamorig:LeftToeBase", "mixamorig:RightUpLeg", "mixamorig:RightLeg",
        "mixamorig:RightFoot", "mixamorig:RightToeBase"}},
      {"Mixamo or Ready Player Me",
       {"mixamorigHips", "mixamorigSpine", "mixamorigSpine2", "mixamorigNeck", "mixamorigHead",
        "mixamorigLeftArm", "mixamorigLeftForeArm", "mixamorigLeftHand", "mixamorigRightArm",
        "mixamorigRightForeArm", "mixamorigRightHand", "mixamorigLeftUpLeg", "mixamorigLeftLeg",
        "mixamorigLeftFoot", "mixamorigLeftToeBase", "mixamorigRightUpLeg", "mixamorigRightLeg",
        "mixamorigRightFoot", "mixamorigRightToeBase"}},
      {"Mixamo or Ready Player Me",
       {"Hips", "Spine", "Spine2", "Neck", "Head", "LeftArm", "LeftForeArm", "LeftHand", "RightArm",
        "RightForeArm", "RightHand", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase",
        "RightUpLeg", "RightLeg", "RightFoot", "RightToeBase"}},
      {"VRM",
       {"J_Bip_C_Hips", "J_Bip_C_Spine", "J_Bip_C_Chest", "J_Bip_C_Neck", "J_Bip_C_Head",
        "J_Bip_L_UpperArm", "J_Bip_L_LowerArm", "J_Bip_L_Hand", "J_Bip_R_UpperArm",
        "J_Bip_R_LowerArm", "J_Bip_R_Hand", "J_Bip_L_UpperLeg", "J_Bip_L_LowerLeg", "J_Bip_L_Foot",
        "J_Bip_L_ToeBase", "J_Bip_R_UpperLeg", "J_Bip_R_LowerLeg", "J_Bip_R_Foot",
        "J_Bip_R_ToeBase"}},
      {"Unity or VRM humanoid",
       {"Hips", "Spine", "Chest", "Neck", "Head", "Left Upper Arm", "Left Lower Arm", "Left Hand",
        "Right Upper Arm", "Right Lower Arm", "Right Hand", "Left Upper Leg", "Left Lower Leg",
        "Left Foot", "Left Toes", "Right Upper Leg", "Right Lower Leg", "Right Foot",
        "Right Toes"}},
      {"Rigify",
       {"DEF-spine", "DEF-spine.001", "DEF-spine.003", "DEF-spine.004", "DEF-spine.006",
        "DEF-upper_arm.L", "DEF-forearm.L", "DEF-hand.L", "DEF-upper_arm.R", "DEF-forearm.R",
        "DEF-hand.R", "DEF-thigh.L", "DEF-shin.L", "DEF-foot.L", "DEF-toe.L", "DEF-thigh.R",
        "DEF-shin.R", "DEF-foot.R", "DEF-toe.R"}},
      {"Unreal or MakeHuman game rig",
       {"pelvis", "spine_01", "spine_03", "neck_01", "head", "upperarm_l", "lowerarm_l", "hand_l",
        "upperarm_r", "lowerarm_r", "hand_r", "thigh_l", "calf_l", "foot_l", "ball_l", "thigh_r",
        "calf_r", "foot_r", "ball_r"}},
  };
  return rigs;
}

RigAsset Renamed(const std::vector<std::string>& names) {
  RigAsset rig = MakeTestRig();
  for (size_t b = 0; b < names.size(); ++b) rig.bones[b].name = names[b];
  return rig;
}

TEST(RigMap, EveryConventionMapsEveryPart) {
  for (const NamedRig& named : NamedRigs()) {
    const RigMap map = MapRigByNames(Renamed(named.names));
    EXPECT_EQ(map.convention, named.convention) << named.names[0];
    for (int p = 0; p < kNumRigParts; ++p) EXPECT_EQ(map.bone[p], p) << named.names[p];
    EXPECT_THAT(map.notes, IsEmpty());
  }
}

TEST(RigMap, LowerCamelHumanoidNamesMap) {
  const RigMap map = MapRigByNames(MakeTestRig());
  for (int p = 0; p < kNumRigParts; ++p) EXPECT_EQ(map.bone[p], p) << TestBoneNames()[p];
}

TEST(RigMap, DeformBonesWinOverTheirCopies) {
  for (const char* copy : {"ORG-", "MCH-", ""}) {
    RigAsset rig = Renamed(NamedRigs()[5].names);
    const size_t num_bones = rig.bones.size();
    for (size_t b = 0; b < num_bones; ++b) {
      RigBone bone = rig.bones[b];
      if (bone.name.starts_with("DEF-")) bone.name.replace(0, 4, copy);
      bone.parent = -1;
      rig.bones.push_back(bone);
    }
    EXPECT_EQ(MapRigByNames(rig)[RigPart::kLeftHand], static_cast<int>(RigPart::kLeftHand));
  }
}

TEST(RigMap, OfBonesWithOneNameTheHighestWins) {
  RigAsset rig = MakeTestRig();
  RigBone leaf = rig.bones[rig.FindBone("leftIndex")];
  leaf.name = "Left_Upper_Arm";
  leaf.parent = rig.FindBone("leftHand");
  rig.bones.insert(rig.bones.end(), leaf);
  EXPECT_EQ(MapRigByNames(rig)[RigPart::kLeftUpperArm], rig.FindBone("leftUpperArm"));
}

TEST(RigMap, ARigWithoutUsableNamesIsAnError) {
  RigAsset rig = MakeTestRig();
  rig.source = "CesiumMan.glb";
  for (size_t b = 0; b < rig.bones.size(); ++b) {
    rig.bones[b].name = "Skeleton_torso_joint_" + std::to_string(b);
  }
  EXPECT_MPC_ERROR(MapRigByNames(rig), kUnsupported, "CesiumMan.glb: no humanoid recognised");
  EXPECT_MPC_ERROR(MapRigByNames(rig), kUnsupported, "Skeleton_torso_joint_20");
}

TEST(RigMap, MissingPartsAreNamed) {
  RigAsset rig = MakeTestRig();
  rig.bones[rig.FindBone("leftFoot")].name = "x";
  rig.bones[rig.FindBone("rightHand")].name = "y";
  EXPECT_MPC_ERROR(MapRigByNames(rig), kUnsupported, "no bone for right_hand, left_foot;");
}

TEST(RigMap, SidesThatContradictTheFeetAreNoted) {
  RigAsset rig = MakeTestRig();
  for (RigBone& bone : rig.bones) {
    bone.scene_from_bone.translation().x() *= -1;  // the feet still point forward
  }
  EXPECT_THAT(MapRigByNames(rig).notes,
              ElementsAre(HasSubstr("bones named left lie on the right")));
}

TEST(RigMap, ReportListsBonesLengthsAndNotes) {
  const RigAsset rig = MakeTestRig();
  RigMap map = MapRigByNames(rig);
  map.notes.push_back("something to know");
  const std::string report = MappingReport(rig, map);
  EXPECT_THAT(report, HasSubstr("left_upper_arm"));
  EXPECT_THAT(report, HasSubstr("280.0 mm"));
  EXPECT_THAT(report, HasSubstr("note: something to know"));
}

}  // namespace
}  // namespace mpc
