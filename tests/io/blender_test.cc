// Blender itself imports the written performance.glb and motion.bvh: every bone at every frame, the
// vertices with morph targets and skin, and the camera are where ours are, to 0.1 mm; so are those of
// the imported mesh with surface.pc2 in a Mesh Cache modifier.
#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>

#include "io/random_performance.h"
#include "io/run_program.h"
#include "io/temp_dir.h"
#include "io/test_gltf.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/bvh.h"
#include "mpc/skeleton/rig_map.h"
#include "support/data_dir.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Json = nlohmann::json;

constexpr int kNumFrames = 24;
constexpr int kFps = 30;
constexpr std::array kComparedFrames = {0, 7, kNumFrames - 1};

Json ToJson(const Eigen::Vector3d& x) { return {x.x(), x.y(), x.z()}; }

void CheckInBlender(const std::filesystem::path& source, const RigAsset& rig,
                    const Skeleton& skeleton, GltfPerformance performance) {
  const testing::TempDir dir;
  performance.camera = Camera::FromFov(640, 480, 1.0);
  // A moving camera; expected is its place in the frame whose vertices are compared.
  performance.scene_from_camera.clear();
  for (int f = 0; f < kNumFrames; ++f) {
    performance.scene_from_camera.push_back(
        Eigen::Translation3d(0.3 + 0.05 * f, 1.2, 4) *
        Eigen::AngleAxisd(3 + 0.02 * f, Eigen::Vector3d(1, 0.1, 0).normalized()));
  }
  const std::vector<Eigen::Matrix3Xf> surface = testing::WavingSurface(rig, performance);
  Pc2Reader reader = testing::WriteSurface(dir / "surface.pc2", surface);
  performance.surface = &reader;
  WriteGltfPerformance(dir / "performance.glb", source, rig, performance);
  const Eigen::MatrixXd poses = testing::RandomMotion(skeleton, kNumFrames, 5);
  WriteBvh(dir / "motion.bvh", BvhFromPoses(skeleton, poses, kFps));

  Json expected = {{"fps", kFps}};
  for (const RigBone& bone : rig.bones) expected["bones"].push_back(bone.name);
  for (const Segment& segment : skeleton.segments) {
    expected["segments"].push_back(segment.name);
  }
  KinematicState state;
  for (int f = 0; f < kNumFrames; ++f) {
    Json bone_heads;
    for (const Eigen::Affine3d& bone : performance.scene_from_bone[f]) {
      bone_heads.push_back(ToJson(bone.translation()));
    }
    expected["bone_heads"].push_back(bone_heads);
    ForwardKinematics(skeleton, poses.col(f), &state);
    Json segment_heads;
    for (int s = 0; s < skeleton.num_segments(); ++s) {
      segment_heads.push_back(ToJson(state.origins.col(s)));
    }
    expected["segment_heads"].push_back(segment_heads);
  }
  for (const int frame : kComparedFrames) {
    Json vertices;
    for (const auto& vertex : surface[static_cast<size_t>(frame)].colwise()) {
      vertices.push_back(ToJson(vertex.cast<double>()));
    }
    expected["vertices"].push_back({{"frame", frame}, {"positions", vertices}});
  }
  const Eigen::Isometry3d& place = performance.scene_from_camera[kComparedFrames.back()];
  expected["camera"] = ToJson(place.translation());
  expected["camera_forward"] = ToJson(place.linear().col(2));
  dir.Write("expected.json", expected.dump());

  const testing::ProgramResult result = testing::RunProgram(
      "blender -b --factory-startup -P '" MPC_BLENDER_SCRIPT "' -- '" + dir.path().string() + "'");
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_NE(result.output.find("CHECK done"), std::string::npos) << result.output;
  for (size_t at = 0; (at = result.output.find("CHECK ", at)) != std::string::npos; ++at) {
    std::printf("%s\n", result.output.substr(at, result.output.find('\n', at) - at).c_str());
  }
}

void CheckHumanoid(const std::filesystem::path& source) {
  const RigAsset rig = ReadRigGltf(source);
  const Character character = BuildCharacter(rig, MapRigByNames(rig));
  CheckInBlender(source, rig, character.skeleton,
                 testing::RandomPerformance(rig, character, kNumFrames, kFps));
}

bool HasBlender() { return testing::RunProgram("blender --version").status == 0; }

TEST(BlenderTest, SyntheticRigs) {
  if (!HasBlender()) GTEST_SKIP() << "needs blender (Debian package)";
  const testing::TempDir dir;
  const std::vector<std::pair<testing::TestRigOptions, testing::TestGltfOptions>> rigs = {
      {{}, {}},
      {{.arm_down_rad = 0.8, .bone_rotations = true}, {.armature = true}},
      {{.arm_down_rad = 0.8}, {.matrix_nodes = true, .moved_rest = true}}};
  for (const auto& [shape, options] : rigs) {
    testing::TestGltf file(testing::MakeTestRig(shape), options);
    // Blender decodes the picture; this one is none.
    for (const char* key : {"materials", "textures", "samplers", "images"}) file.json.erase(key);
    file.json["meshes"][0]["primitives"][0].erase("material");
    CheckHumanoid(dir.Write("actor.glb", file.Bytes()));
  }
}

TEST(BlenderTest, RealActors) {
  if (!HasBlender()) GTEST_SKIP() << "needs blender (Debian package)";
  MPC_REQUIRE_DATA();
  const std::filesystem::path actors = *testing::DataDir() / "actors";
  CheckHumanoid(actors / "male_tpose.glb");
  CheckHumanoid(actors / "female_apose.glb");
  const RigAsset rig = ReadRigGltf(actors / "CesiumMan.glb");
  CheckInBlender(actors / "CesiumMan.glb", rig, DefaultSkeleton(),
                 testing::RandomBonePerformance(rig, kNumFrames, kFps));
}

}  // namespace
}  // namespace mpc
