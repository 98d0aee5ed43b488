#include "mpc/io/rig_gltf.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "io/gltf_probe.h"
#include "io/temp_dir.h"
#include "mpc/core/log.h"
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

// A PNG of one pixel.
std::vector<unsigned char> OnePixel() {
  return {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
          0x44, 0x52, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00,
          0x00, 0x90, 0x77, 0x53, 0xde, 0x00, 0x00, 0x00, 0x0c, 0x49, 0x44, 0x41, 0x54, 0x78,
          0x9c, 0x63, 0x38, 0x31, 0xad, 0x02, 0x00, 0x04, 0x00, 0x01, 0xd7, 0xb8, 0xd3, 0x0e,
          0x08, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
}
constexpr const char* kOnePixelUri =
    "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQ"
    "d1PeAAAADElEQVR4nGM4Ma0CAAQAAde40w4IAAAAAElFTkSuQmCC";

RigAsset TexturedRig() {
  RigAsset rig = testing::MakeTestRig();
  RigMesh& body = rig.meshes[0];
  body.uv = Eigen::Matrix2Xf::Random(2, body.mesh.positions.cols());
  body.texture = OnePixel();
  return rig;
}

// The textured rig's file read with its JSON changed, and the warnings that gave.
RigAsset ReadChanged(const std::function<void(nlohmann::ordered_json*)>& change,
                     std::string* warnings) {
  const testing::TempDir folder;
  WriteRigGltf(folder / "rig.glb", TexturedRig());
  testing::GltfProbe probe(folder / "rig.glb");
  change(&probe.json);
  std::string text = probe.json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string bytes = "glTF";
  const auto number = [&bytes](size_t n) {
    const auto word = static_cast<std::uint32_t>(n);
    bytes.append(reinterpret_cast<const char*>(&word), sizeof(word));
  };
  number(2);
  number(28 + text.size() + probe.binary.size());
  number(text.size());
  bytes += "JSON" + text;
  number(probe.binary.size());
  bytes += std::string("BIN\0", 4) + probe.binary;
  SetLogSink([warnings](LogLevel, std::string_view message) { *warnings += message; });
  RigAsset rig = ReadRigGltf(folder.Write("changed.glb", bytes));
  SetLogSink({});
  return rig;
}

TEST(RigGltfTest, TheTextureComesBackAsItWas) {
  const testing::TempDir folder;
  RigAsset rig = TexturedRig();
  RigMesh plain = testing::MakeTestRig().meshes[0];
  rig.meshes.push_back(plain);
  WriteRigGltf(folder / "rig.glb", rig);
  const RigAsset read = ReadRigGltf(folder / "rig.glb");
  ASSERT_EQ(read.meshes.size(), 2u);
  EXPECT_EQ(read.meshes[0].texture, OnePixel());
  EXPECT_TRUE(read.meshes[1].texture.empty());
}

TEST(RigGltfTest, ATextureMustBeAPictureWithCoordinates) {
  const testing::TempDir folder;
  RigAsset rig = TexturedRig();
  rig.meshes[0].texture = {'G', 'I', 'F', '8'};
  EXPECT_MPC_ERROR(WriteRigGltf(folder / "rig.glb", rig), kBadFile, "texture");
  rig = TexturedRig();
  rig.meshes[0].uv.resize(2, 0);
  EXPECT_MPC_ERROR(WriteRigGltf(folder / "rig.glb", rig), kBadFile, "texture");
}

TEST(RigGltfTest, ReadsADataUri) {
  std::string warnings;
  const RigAsset rig = ReadChanged(
      [](auto* json) {
        (*json)["images"][0] = {{"uri", kOnePixelUri}};
      },
      &warnings);
  EXPECT_EQ(rig.meshes[0].texture, OnePixel());
  EXPECT_EQ(warnings, "");
}

TEST(RigGltfTest, ABrokenTextureIsLeftOutWithAWarning) {
  using Json = nlohmann::ordered_json;
  const auto expect_none = [](const std::function<void(Json*)>& change) {
    std::string warnings;
    const RigAsset rig = ReadChanged(change, &warnings);
    EXPECT_TRUE(rig.meshes[0].texture.empty());
    EXPECT_NE(warnings.find("texture"), std::string::npos) << warnings;
  };
  expect_none([](Json* json) { (*json)["textures"][0]["source"] = 7; });
  expect_none([](Json* json) { (*json)["images"][0]["bufferView"] = 0; });  // no picture there
  expect_none([](Json* json) {
    (*json)["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 3;
  });
  expect_none([](Json* json) {
    (*json)["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 1;
  });
  expect_none([](Json* json) {
    (*json)["images"][0] = {{"uri", "data:image/png;base64,AAAAAAAAAAAAAAAA"}};
  });
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
