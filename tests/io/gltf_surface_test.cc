// A captured surface in a glTF file: a viewer that adds the morph targets and skins shows it.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <numbers>

#include "io/gltf_probe.h"
#include "io/random_performance.h"
#include "io/temp_dir.h"
#include "io/test_gltf.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/gltf.h"
#include "mpc/skeleton/proportions.h"
#include "mpc/skeleton/rig_map.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Document = nlohmann::ordered_json;
using testing::GltfProbe;
using testing::TempDir;
using testing::TestGltf;
using testing::TestGltfOptions;

constexpr double kExact = 2e-5;  // m: 10 um, and numbers as float

GltfPerformance Performance(const RigAsset& rig, int num_frames) {
  return testing::RandomBonePerformance(rig, num_frames, 30);
}

// Farthest distance of the shown vertices of all primitives in a frame from the surface.
double WorstShown(const GltfProbe& probe, const RigAsset& rig, const Eigen::Matrix3Xf& surface,
                  int frame) {
  double worst = 0;
  Eigen::Index begin = 0;
  for (const RigMesh& mesh : rig.meshes) {
    const Eigen::Matrix3Xd shown =
        probe.ShownVertices(mesh.file_mesh, mesh.file_primitive, 0, frame);
    const Eigen::Matrix3Xd expected = surface.middleCols(begin, shown.cols()).cast<double>();
    worst = std::max(worst, (shown - expected).colwise().norm().maxCoeff());
    begin += shown.cols();
  }
  return worst;
}

class GltfSurfaceTest : public ::testing::Test {
 protected:
  GltfSurfaceError Write(const std::filesystem::path& source, const RigAsset& rig,
                         const std::vector<Eigen::Matrix3Xf>& surface, int frames_per_target = 1) {
    Pc2Reader reader = testing::WriteSurface(dir_ / "surface.pc2", surface);
    performance_.surface = &reader;
    performance_.frames_per_target = frames_per_target;
    const GltfSurfaceError error =
        WriteGltfPerformance(dir_ / "out.glb", source, rig, performance_);
    performance_.surface = nullptr;
    return error;
  }

  // Every frame shows its surface.
  void ExpectExact(const std::filesystem::path& source, const RigAsset& rig) {
    const std::vector<Eigen::Matrix3Xf> surface = testing::WavingSurface(rig, performance_);
    const GltfSurfaceError error = Write(source, rig, surface);
    const GltfProbe probe(dir_ / "out.glb");
    EXPECT_EQ(error.num_targets, static_cast<int>(surface.size()));
    EXPECT_LT(error.max_m, kExact);
    for (size_t f = 0; f < surface.size(); ++f) {
      EXPECT_LT(WorstShown(probe, rig, surface[f], static_cast<int>(f)), kExact) << f;
    }
  }

  TempDir dir_;
  GltfPerformance performance_;
};

TEST_F(GltfSurfaceTest, AViewerShowsTheSurfaceOfEveryFrame) {
  for (const testing::TestRigOptions& shape : testing::TestRigVariants()) {
    for (const TestGltfOptions& options : testing::TestGltfVariants()) {
      if (options.two_sets) continue;  // the probe reads one
      TestGltf file(testing::MakeTestRig(shape), options);
      const auto source = dir_.Write(options.data_uri ? "a.gltf" : "a.glb", file.Bytes());
      const RigAsset rig = ReadRigGltf(source);
      performance_ = Performance(rig, 3);
      ExpectExact(source, rig);
    }
  }
}

TEST_F(GltfSurfaceTest, OtherRestPoseAndOtherProportionsAreFollowed) {
  for (const TestGltfOptions& options : std::vector<TestGltfOptions>{
           {.armature = true, .moved_rest = true}, {.matrix_nodes = true, .moved_rest = true}}) {
    TestGltf file(testing::MakeTestRig({.arm_down_rad = 0.8}), options);
    const auto source = dir_.Write("a.glb", file.Bytes());
    RigAsset rig = ReadRigGltf(source);
    Character character = BuildCharacter(rig, MapRigByNames(rig));
    Proportions proportions;
    proportions.overall = 1.1;
    proportions.part[static_cast<size_t>(BodyPart::kThigh)] = 1.2;
    ApplyProportions(proportions, &character, &rig);
    performance_ = Performance(rig, 3);
    ExpectExact(source, rig);
  }
}

TEST_F(GltfSurfaceTest, OnlyVerticesThatSkinningMissesTakeSpace) {
  TestGltf file(testing::MakeTestRig(), {});
  const auto source = dir_.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  performance_ = Performance(rig, 20);
  std::vector<Eigen::Matrix3Xf> surface = testing::WavingSurface(rig, performance_, 0);
  surface[4](1, 7) += 0.1f;
  surface[4](1, 9) += 0.1f;
  EXPECT_LT(Write(source, rig, surface).max_m, kExact);
  const GltfProbe probe(dir_ / "out.glb");
  EXPECT_LT(WorstShown(probe, rig, surface[4], 4), kExact);
  const Document& targets = probe.json["meshes"][0]["primitives"][0]["targets"];
  ASSERT_EQ(targets.size(), 20u);
  for (size_t t = 0; t < 20; ++t) {
    const Document& accessor = probe.json["accessors"][targets[t]["POSITION"].get<int>()];
    EXPECT_FALSE(accessor.contains("bufferView"));
    EXPECT_EQ(accessor.contains("sparse") ? accessor["sparse"]["count"].get<int>() : 0,
              t == 4 ? 2 : 0);
  }
  EXPECT_EQ(probe.json["meshes"][0]["extras"]["targetNames"][4], "frame_000004");
}

TEST_F(GltfSurfaceTest, FewerTargetsAreExactAtTheirFramesAndTheErrorBetweenIsStated) {
  TestGltf file(testing::MakeTestRig(), {});
  const auto source = dir_.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  performance_ = Performance(rig, 10);
  const std::vector<Eigen::Matrix3Xf> surface = testing::WavingSurface(rig, performance_);
  const GltfSurfaceError error = Write(source, rig, surface, 4);
  EXPECT_EQ(error.num_targets, 4);  // frames 0, 4, 8, 9
  const GltfProbe probe(dir_ / "out.glb");
  double worst = 0;
  for (int f = 0; f < 10; ++f) {
    const double now = WorstShown(probe, rig, surface[static_cast<size_t>(f)], f);
    if (f % 4 == 0 || f == 9) {
      EXPECT_LT(now, kExact) << f;
    }
    worst = std::max(worst, now);
  }
  EXPECT_GT(worst, 1e-3);
  EXPECT_NEAR(error.max_m, worst, kExact);
  EXPECT_GT(error.mean_m, 0);
  EXPECT_LT(error.mean_m, error.max_m);
  // More frames per target than there are frames: the first and the last.
  EXPECT_EQ(Write(source, rig, surface, 1000).num_targets, 2);
  performance_ = Performance(rig, 1);
  EXPECT_EQ(Write(source, rig, {surface[0]}, 4).num_targets, 1);
}

TEST_F(GltfSurfaceTest, SeveralPrimitivesLinesAndTargetsOfTheSourceStay) {
  TestGltf file(testing::MakeTestRig(), {});
  Document& mesh = file.json["meshes"][0];
  const Document position = mesh["primitives"][0]["attributes"]["POSITION"];
  mesh["primitives"][0]["targets"] = {{{"POSITION", position}}};  // a shape that must stay away
  mesh["primitives"].push_back(Document(mesh["primitives"][0]));  // the same vertices again
  mesh["primitives"].push_back(Document(mesh["primitives"][0]));
  mesh["primitives"][2]["mode"] = 1;  // lines: no part of the rig
  mesh["weights"] = {0.0};
  mesh["extras"]["targetNames"] = {"smile"};
  const auto source = dir_.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  ASSERT_EQ(rig.meshes.size(), 2u);
  performance_ = Performance(rig, 3);
  std::vector<Eigen::Matrix3Xf> surface = testing::WavingSurface(rig, performance_);
  surface[1].rightCols(rig.meshes[1].mesh.positions.cols()).array() += 0.02f;  // on its own
  EXPECT_LT(Write(source, rig, surface).max_m, kExact);
  const GltfProbe probe(dir_ / "out.glb");
  for (int f = 0; f < 3; ++f) {
    EXPECT_LT(WorstShown(probe, rig, surface[static_cast<size_t>(f)], f), kExact);
  }
  const Document& written = probe.json["meshes"][0];
  for (int p = 0; p < 3; ++p) EXPECT_EQ(written["primitives"][p]["targets"].size(), 4u);
  EXPECT_TRUE(probe.Values(written["primitives"][2]["targets"][2]["POSITION"]).isZero());
  EXPECT_EQ(written["weights"].size(), 4u);
  EXPECT_EQ(written["extras"]["targetNames"][0], "smile");
  EXPECT_EQ(written["extras"]["targetNames"][3], "frame_000002");
}

// Two bones that are turned against each other by half a turn flatten what lies between them: not
// every place can be reached then, but the file stays finite and says so.
TEST_F(GltfSurfaceTest, CollapsedSkinningIsStated) {
  const RigAsset shape = testing::MakeTestRig();
  TestGltf file(shape, {});
  const auto source = dir_.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  performance_ = Performance(rig, 2);
  const int bone = rig.FindBone("leftLowerArm");
  performance_.scene_from_bone[1] = performance_.scene_from_bone[0];
  const int parent = rig.bones[bone].parent;
  performance_.scene_from_bone[1][bone] =
      performance_.scene_from_bone[1][parent] * rig.bones[parent].scene_from_bone.inverse() *
      rig.bones[bone].scene_from_bone *
      Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX());
  std::vector<Eigen::Matrix3Xf> surface = testing::WavingSurface(rig, performance_);
  const GltfSurfaceError error = Write(source, rig, surface);
  const GltfProbe probe(dir_ / "out.glb");
  const double worst = WorstShown(probe, rig, surface[1], 1);
  EXPECT_NEAR(error.max_m, worst, kExact);
  EXPECT_LT(worst, 0.06);  // no farther than without offsets
  const Document& targets = probe.json["meshes"][0]["primitives"][0]["targets"];
  EXPECT_LT(probe.Values(targets[1]["POSITION"]).cwiseAbs().maxCoeff(), 3);
}

TEST_F(GltfSurfaceTest, RefusesWhatDoesNotFit) {
  TestGltf file(testing::MakeTestRig(), {});
  const auto source = dir_.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  performance_ = Performance(rig, 3);
  std::vector<Eigen::Matrix3Xf> surface = testing::WavingSurface(rig, performance_);
  EXPECT_MPC_ERROR(Write(source, rig, surface, 0), kInvalidArgument, "every 0 frames");
  EXPECT_MPC_ERROR(Write(source, rig, {surface[0]}), kMismatch, "1 frames");
  EXPECT_MPC_ERROR(Write(source, rig, {3, surface[0].leftCols(5)}), kMismatch, "5 vertices");

  // A number in the cache's last frame is not one.
  testing::WriteSurface(dir_ / "bad.pc2", surface);
  std::string bytes = ReadFile(dir_ / "bad.pc2");
  bytes.replace(bytes.size() - 4, 4, std::string("\0\0\xc0\x7f", 4));
  Pc2Reader bad(dir_.Write("bad.pc2", bytes));
  performance_.surface = &bad;
  performance_.frames_per_target = 1;
  EXPECT_MPC_ERROR(WriteGltfPerformance(dir_ / "bad.glb", source, rig, performance_), kBadFile,
                   "frame 2");
  EXPECT_FALSE(std::filesystem::exists(dir_ / "bad.glb"));

  // One mesh with two skins would need two surfaces.
  Document& json = file.json;
  json["skins"].push_back(Document(json["skins"][0]));
  for (const Document& node : Document(json["nodes"])) {
    if (!node.contains("mesh")) continue;
    json["nodes"].push_back(node);
    json["nodes"].back()["skin"] = 1;
    json["scenes"][0]["nodes"].push_back(json["nodes"].size() - 1);
  }
  const auto twice = dir_.Write("b.glb", file.Bytes());
  const RigAsset rig_twice = ReadRigGltf(twice);
  ASSERT_EQ(rig_twice.meshes.size(), 2u);
  performance_ = Performance(rig_twice, 3);
  EXPECT_MPC_ERROR(Write(twice, rig_twice, testing::WavingSurface(rig_twice, performance_)),
                   kUnsupported, "two skins");
  for (const auto& entry : std::filesystem::directory_iterator(dir_.path())) {
    EXPECT_EQ(entry.path().string().find(".part-"), std::string::npos) << entry.path();
  }
}

}  // namespace
}  // namespace mpc
