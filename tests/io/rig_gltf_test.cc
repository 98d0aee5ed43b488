#include "mpc/io/rig_gltf.h"

#include <gtest/gtest.h>

#include <limits>

#include "io/gltf_probe.h"
#include "io/temp_dir.h"
#include "mpc/io/gltf.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

// Weights as a full matrix, bones x vertices: the order of influences has no meaning.
Eigen::MatrixXf DenseWeights(const RigMesh& mesh, size_t num_bones) {
  Eigen::MatrixXf dense =
      Eigen::MatrixXf::Zero(static_cast<Eigen::Index>(num_bones), mesh.mesh.positions.cols());
  for (Eigen::Index v = 0; v < dense.cols(); ++v) {
    for (Eigen::Index k = 0; k < mesh.bones.rows(); ++k) {
      dense(mesh.bones(k, v), v) += mesh.weights(k, v);
    }
  }
  return dense;
}

TEST(RigGltfTest, ReadsBackAsTheSameRig) {
  const testing::TempDir folder;
  for (const testing::TestRigOptions& options : testing::TestRigVariants()) {
    RigAsset rig = testing::MakeTestRig(options);
    RigMesh& body = rig.meshes[0];
    body.uv = Eigen::Matrix2Xf::Random(2, body.mesh.positions.cols());
    // Six influences need two sets.
    body.bones.conservativeResize(6, Eigen::NoChange);
    body.weights.conservativeResize(6, Eigen::NoChange);
    body.bones.bottomRows(4).setConstant(3);
    body.weights.bottomRows(4).setZero();
    body.weights.row(5).setConstant(0.25F);
    WriteRigGltf(folder / "rig.glb", rig);
    const RigAsset read = ReadRigGltf(folder / "rig.glb");

    ASSERT_EQ(read.bones.size(), rig.bones.size());
    for (size_t b = 0; b < rig.bones.size(); ++b) {
      const int found = read.FindBone(rig.bones[b].name);
      ASSERT_GE(found, 0) << rig.bones[b].name;
      const RigBone& bone = read.bones[static_cast<size_t>(found)];
      EXPECT_TRUE(bone.scene_from_bone.isApprox(rig.bones[b].scene_from_bone, 1e-5));
      ASSERT_EQ(bone.parent < 0, rig.bones[b].parent < 0);
      if (bone.parent < 0) continue;
      EXPECT_EQ(read.bones[static_cast<size_t>(bone.parent)].name,
                rig.bones[static_cast<size_t>(rig.bones[b].parent)].name);
    }
    ASSERT_EQ(read.meshes.size(), 1u);
    const RigMesh& mesh = read.meshes[0];
    EXPECT_LT((mesh.mesh.positions - body.mesh.positions).cwiseAbs().maxCoeff(), 2e-6);
    EXPECT_EQ(mesh.mesh.triangles, body.mesh.triangles);
    EXPECT_EQ(mesh.uv, body.uv);
    EXPECT_EQ(mesh.name, body.name);
    const Eigen::MatrixXf weights = DenseWeights(mesh, read.bones.size());
    for (size_t b = 0; b < rig.bones.size(); ++b) {
      EXPECT_EQ(weights.row(read.FindBone(rig.bones[b].name)),
                DenseWeights(body, rig.bones.size()).row(static_cast<Eigen::Index>(b)));
    }
  }
}

TEST(RigGltfTest, NormalsAreUnitVectors) {
  const testing::TempDir folder;
  WriteRigGltf(folder / "rig.glb", testing::MakeTestRig());
  const testing::GltfProbe probe(folder / "rig.glb");
  const int accessor = probe.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"];
  const Eigen::MatrixXd normals = probe.Values(accessor);
  EXPECT_LT((normals.colwise().norm().array() - 1).abs().maxCoeff(), 1e-5);
}

TEST(RigGltfTest, RefusesWhatIsNoRigAndReportsAFullDisk) {
  const testing::TempDir folder;
  RigAsset rig = testing::MakeTestRig();
  EXPECT_MPC_ERROR(WriteRigGltf("/dev/full", rig), kWriteFailed, "/dev/full");
  rig.meshes[0].mesh.positions(0, 0) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_MPC_ERROR(WriteRigGltf(folder / "rig.glb", rig), kBadFile, "");
  EXPECT_FALSE(std::filesystem::exists(folder / "rig.glb"));
}

}  // namespace
}  // namespace mpc
