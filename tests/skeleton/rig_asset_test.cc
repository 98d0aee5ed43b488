#include "mpc/skeleton/rig_asset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MakeTestRig;

void ExpectInvalid(const RigAsset& rig, const std::string& text) {
  EXPECT_MPC_ERROR(rig.Validate(), kBadFile, text);
}

TEST(RigAsset, AGoodRigIsValid) {
  const RigAsset rig = MakeTestRig();
  EXPECT_NO_THROW(rig.Validate());
  EXPECT_EQ(rig.num_vertices(), rig.meshes[0].mesh.positions.cols());
  EXPECT_EQ(rig.bones[rig.FindBone("head")].name, "head");
  EXPECT_EQ(rig.FindBone("tail"), -1);
}

TEST(RigAsset, EveryFaultIsNamed) {
  RigAsset empty;
  empty.source = "model.glb";
  ExpectInvalid(empty, "model.glb: unusable rig: no bones; no skinned mesh");

  RigAsset rig = MakeTestRig();
  rig.bones[3].parent = 99;
  ExpectInvalid(rig, "\"neck\" has parent 99 of 21");

  rig = MakeTestRig();
  rig.bones[0].parent = 4;
  ExpectInvalid(rig, "is its own ancestor");

  rig = MakeTestRig();
  rig.bones[2].scene_from_bone.translation().x() = std::numeric_limits<double>::quiet_NaN();
  ExpectInvalid(rig, "\"chest\" has a bind pose that is not finite");

  rig = MakeTestRig();
  rig.meshes[0].mesh.positions(1, 5) = std::numeric_limits<float>::infinity();
  ExpectInvalid(rig, "mesh 0 \"body\": a position is not a finite number");

  rig = MakeTestRig();
  rig.meshes[0].mesh.triangles(0, 0) = 1 << 20;
  ExpectInvalid(rig, "a triangle index is outside");

  rig = MakeTestRig();
  rig.meshes[0].bones(1, 1) = -3;
  ExpectInvalid(rig, "a bone index is outside the rig's 21 bones");

  rig = MakeTestRig();
  rig.meshes[0].weights.conservativeResize(2, 10);
  ExpectInvalid(rig, "weights 2x10");

  rig = MakeTestRig();
  rig.meshes[0].weights(0, 3) = std::numeric_limits<float>::quiet_NaN();
  ExpectInvalid(rig, "a weight is not a finite number");

  rig = MakeTestRig();
  rig.meshes[0].uv.setZero(2, 3);
  ExpectInvalid(rig, "3 texture coordinates");

  rig = MakeTestRig();
  rig.bones[3].parent = 99;
  rig.meshes[0].bones(0, 0) = 77;
  ExpectInvalid(rig, "of 21 bones; mesh 0");
}

TEST(CheckWeights, CountsWhatIsWrong) {
  RigAsset rig = MakeTestRig();
  EXPECT_TRUE(CheckWeights(rig).empty());
  rig.meshes[0].weights.col(0).setZero();
  rig.meshes[0].weights.col(1) << 1.5f, -0.5f;
  rig.meshes[0].weights.col(2) << 0.5f, 0.2f;
  rig.meshes[0].weights.col(3) << 0.5f, 0.495f;  // within the tolerance
  EXPECT_THAT(CheckWeights(rig), ElementsAre(HasSubstr("1 of"), HasSubstr("no weight at all"),
                                             HasSubstr("do not sum to one")));
  EXPECT_THAT(CheckWeights(rig)[0], HasSubstr("negative"));
}

}  // namespace
}  // namespace mpc
