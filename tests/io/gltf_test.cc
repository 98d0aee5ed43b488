// Laws of the glTF reader and writer on rigs of every shape: what is read is what was written, and
// a viewer shows of the written performance exactly the bones and vertices it was made from.
#include "mpc/io/gltf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "io/gltf_probe.h"
#include "io/random_performance.h"
#include "io/temp_dir.h"
#include "io/test_gltf.h"
#include "mpc/io/rig_gltf.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/proportions.h"
#include "mpc/skeleton/rig_map.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using testing::GltfProbe;
using testing::TempDir;
using testing::TestGltf;
using testing::TestGltfOptions;
using testing::TestRigOptions;

constexpr double kTolerance = 1e-4;  // m

double BoneError(const Eigen::Affine3d& a, const Eigen::Affine3d& b) {
  // Of the origin, and of a point 0.1 m away.
  const double scale = b.linear().col(0).norm();
  return (a.translation() - b.translation()).norm() +
         0.1 * (a.linear() - b.linear()).norm() / scale;
}

GltfPerformance RandomPerformance(const RigAsset& rig, const Character& character, int num_frames) {
  GltfPerformance performance = testing::RandomPerformance(rig, character, num_frames, 29.97);
  for (double& time : performance.times_s) time += 0.5;
  return performance;
}

void ExpectShown(const GltfProbe& probe, const RigAsset& rig, const GltfPerformance& performance) {
  const int num_frames = static_cast<int>(performance.times_s.size());
  for (int f = 0; f < num_frames; ++f) {
    const std::vector<Eigen::Affine3d> worlds = probe.NodeWorlds(f);
    for (size_t b = 0; b < rig.bones.size(); ++b) {
      ASSERT_LT(BoneError(worlds[rig.bones[b].node], performance.scene_from_bone[f][b]), kTolerance)
          << rig.bones[b].name << " frame " << f;
    }
  }
  for (const int f : {0, num_frames - 1}) {
    const Eigen::Matrix3Xd difference =
        probe.ShownVertices(0, 0, 0, f) -
        testing::SkinnedVertices(rig, performance.scene_from_bone[f]);
    EXPECT_LT(difference.colwise().norm().maxCoeff(), kTolerance) << "frame " << f;
  }
}

TEST(GltfReadTest, ReadsEveryWayOfWritingTheSameRig) {
  const TempDir dir;
  for (const TestRigOptions& shape : testing::TestRigVariants()) {
    const RigAsset rig = testing::MakeTestRig(shape);
    for (const TestGltfOptions& options : testing::TestGltfVariants()) {
      TestGltf file(rig, options);
      const RigAsset read =
          ReadRigGltf(dir.Write(options.data_uri ? "a.gltf" : "a.glb", file.Bytes()));
      ASSERT_EQ(read.bones.size(), rig.bones.size());
      for (size_t b = 0; b < rig.bones.size(); ++b) {
        EXPECT_EQ(read.bones[b].name, rig.bones[b].name);
        EXPECT_EQ(read.bones[b].parent, rig.bones[b].parent);
        EXPECT_LT(BoneError(read.bones[b].scene_from_bone, rig.bones[b].scene_from_bone), 1e-5);
      }
      ASSERT_EQ(read.meshes.size(), 1u);
      const RigMesh& mesh = read.meshes[0];
      EXPECT_EQ(mesh.mesh.triangles, rig.meshes[0].mesh.triangles);
      EXPECT_LT((mesh.mesh.positions - rig.meshes[0].mesh.positions).colwise().norm().maxCoeff(),
                1e-5f);
      EXPECT_EQ(mesh.weights.rows(), options.two_sets ? 8 : 4);
      EXPECT_LT((mesh.weights.colwise().sum().array() - 1).abs().maxCoeff(), 1e-4f);
      for (Eigen::Index v = 0; v < mesh.weights.cols(); ++v) {
        EXPECT_EQ(mesh.bones(0, v), rig.meshes[0].bones(0, v));
      }
    }
  }
}

TEST(GltfReadTest, RigsMadeByProgramsComeBackAsTheyWere) {
  const TempDir dir;
  for (const TestRigOptions& shape : testing::TestRigVariants()) {
    RigAsset rig = testing::MakeTestRig(shape);
    rig.meshes[0].uv = Eigen::Matrix2Xf::Random(2, rig.num_vertices());
    WriteRigGltf(dir / "a.glb", rig);
    const RigAsset read = ReadRigGltf(dir / "a.glb");
    ASSERT_EQ(read.bones.size(), rig.bones.size());
    for (size_t b = 0; b < rig.bones.size(); ++b) {
      EXPECT_EQ(read.bones[b].name, rig.bones[b].name);
      EXPECT_EQ(read.bones[b].parent, rig.bones[b].parent);
      EXPECT_LT(BoneError(read.bones[b].scene_from_bone, rig.bones[b].scene_from_bone), 1e-5);
    }
    const RigMesh& mesh = read.meshes[0];
    EXPECT_EQ(mesh.mesh.triangles, rig.meshes[0].mesh.triangles);
    EXPECT_EQ(mesh.uv, rig.meshes[0].uv);
    EXPECT_EQ(mesh.weights.topRows(2), rig.meshes[0].weights);
    EXPECT_LT((mesh.mesh.positions - rig.meshes[0].mesh.positions).colwise().norm().maxCoeff(),
              1e-5f);
  }
  EXPECT_MPC_ERROR(WriteRigGltf(dir / "a.glb", RigAsset()), kBadFile, "");
  EXPECT_MPC_ERROR(WriteRigGltf("/dev/full", testing::MakeTestRig()), kWriteFailed, "/dev/full");
}

TEST(GltfReadTest, RestPoseThatIsNotTheBindPoseDoesNotMoveTheMesh) {
  const TempDir dir;
  const RigAsset rig = testing::MakeTestRig({.arm_down_rad = 0.8});
  for (const bool armature : {false, true}) {
    TestGltf file(rig, {.armature = armature, .moved_rest = true});
    const RigAsset read = ReadRigGltf(dir.Write("a.glb", file.Bytes()));
    for (size_t b = 0; b < rig.bones.size(); ++b) {
      EXPECT_LT(BoneError(read.bones[b].scene_from_bone, rig.bones[b].scene_from_bone), 1e-5);
    }
    EXPECT_LT((read.meshes[0].mesh.positions - rig.meshes[0].mesh.positions).norm(), 1e-3f);
  }
}

TEST(GltfReadTest, VerticesWithoutWeightsStayWithTheMesh) {
  const TempDir dir;
  RigAsset rig = testing::MakeTestRig();
  rig.meshes[0].weights.col(7).setZero();
  TestGltf file(rig, {.armature = true});
  const RigAsset read = ReadRigGltf(dir.Write("a.glb", file.Bytes()));
  EXPECT_LT((read.meshes[0].mesh.positions - rig.meshes[0].mesh.positions).norm(), 1e-3f);
}

TEST(GltfReadTest, StripsAndFansAreTakenApart) {
  const TempDir dir;
  TestGltf file(testing::MakeTestRig(), {});
  auto& primitive = file.json["meshes"][0]["primitives"][0];
  auto& indices = file.json["accessors"][primitive["indices"].get<int>()];
  const GltfProbe probe(dir.Write("a.glb", file.Bytes()));
  const Eigen::MatrixXd corners = probe.Values(primitive["indices"]);
  indices["count"] = 5;
  for (const auto& [mode, expected] :
       {std::pair(5, Triangles((Triangles(3, 3) << 0, 1, 2, 1, 3, 3, 2, 2, 4).finished())),
        std::pair(6, Triangles((Triangles(3, 3) << 0, 0, 0, 1, 2, 3, 2, 3, 4).finished()))}) {
    primitive["mode"] = mode;
    const RigAsset read = ReadRigGltf(dir.Write("a.glb", file.Bytes()));
    ASSERT_EQ(read.meshes[0].mesh.triangles.cols(), 3);
    for (int i = 0; i < 9; ++i) {
      EXPECT_EQ(read.meshes[0].mesh.triangles(i), corners(expected(i)));
    }
  }
}

TEST(GltfReadTest, NamesTheFaultInABrokenFile) {
  const TempDir dir;
  const RigAsset rig = testing::MakeTestRig();
  using Json = nlohmann::ordered_json;
  const auto read = [&](const std::function<void(Json*)>& breaks) {
    TestGltf file(rig, {});
    breaks(&file.json);
    ReadRigGltf(dir.Write("a.glb", file.Bytes()));
  };
  const auto attributes = [](Json* json) -> Json& {
    return (*json)["meshes"][0]["primitives"][0]["attributes"];
  };
  EXPECT_MPC_ERROR(ReadRigGltf(dir / "no.glb"), kFileNotFound, "no.glb");
  EXPECT_MPC_ERROR(ReadRigGltf(dir.Write("a.glb", "")), kBadFile, "a.glb");
  EXPECT_MPC_ERROR(ReadRigGltf(dir.Write("a.glb", "glTF")), kBadFile, "JSON chunk");
  EXPECT_MPC_ERROR(ReadRigGltf(dir.Write("a.gltf", "{}")), kBadFile, "a.gltf");
  EXPECT_MPC_ERROR(read([](Json* j) { j->erase("skins"); }), kBadFile, "skin 0 of 0");
  EXPECT_MPC_ERROR(read([](Json* j) {
                     for (Json& node : (*j)["nodes"]) node.erase("skin");
                   }),
                   kBadFile, "no skinned mesh");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["nodes"][3]["children"] = {1}; }), kBadFile, "parents");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["nodes"][3]["children"] = {999}; }), kBadFile, "999");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["nodes"][0]["children"] = {0}; }), kBadFile, "ancestor");
  EXPECT_MPC_ERROR(read([](Json* j) {
                     (*j)["nodes"][2]["rotation"] = {1, 2};
                   }),
                   kBadFile, "node 2");
  EXPECT_MPC_ERROR(read([](Json* j) {
                     (*j)["nodes"][2]["rotation"] = {0, 0, 0, 0};
                   }),
                   kBadFile, "rotation of length 0");
  EXPECT_MPC_ERROR(read([&](Json* j) { attributes(j).erase("JOINTS_0"); }), kBadFile, "no joints");
  EXPECT_MPC_ERROR(read([&](Json* j) { attributes(j).erase("POSITION"); }), kBadFile, "positions");
  EXPECT_MPC_ERROR(read([&](Json* j) { attributes(j)["POSITION"] = 77; }), kBadFile, "accessor 77");
  EXPECT_MPC_ERROR(read([&](Json* j) { attributes(j)["POSITION"] = attributes(j)["WEIGHTS_0"]; }),
                   kBadFile, "expected 3 components");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["accessors"][0]["count"] = 1000000; }), kBadFile,
                   "do not fit");
  EXPECT_MPC_ERROR(read([](Json* j) {
                     (*j)["accessors"][0].erase("bufferView");
                     (*j)["accessors"][0]["count"] = 4000000000u;
                   }),
                   kBadFile, "without data");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["accessors"][0]["byteOffset"] = 4000000; }), kBadFile,
                   "do not fit");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["bufferViews"][0]["byteLength"] = 99999999; }), kBadFile,
                   "bufferViews[0]");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["bufferViews"][0]["buffer"] = 3; }), kBadFile,
                   "buffers");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["scene"] = 9; }), kBadFile, "scene 9");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["skins"][0]["joints"] = {0}; }), kBadFile,
                   "follows joint");
  EXPECT_MPC_ERROR(read([](Json* j) { (*j)["skins"][0]["joints"][4] = 500; }), kBadFile, "500");
  EXPECT_MPC_ERROR(read([](Json* j) {
                     (*j)["nodes"][0]["scale"] = {-1, 1, 1};
                   }),
                   kUnsupported, "mirrored");
  EXPECT_MPC_ERROR(
      read([](Json* j) { (*j)["extensionsRequired"] = {"KHR_draco_mesh_compression"}; }),
      kUnsupported, "draco");
  EXPECT_MPC_ERROR(read([](Json* j) {
                     Json deep = 1;
                     for (int i = 0; i < 1000; ++i) deep = Json::array({deep});
                     (*j)["extras"] = deep;
                   }),
                   kBadFile, "nested");
}

TEST(GltfReadTest, RefusesNumbersThatAreNotFinite) {
  const TempDir dir;
  TestGltf file(testing::MakeTestRig(), {});
  const float nan = std::nanf("");
  std::memcpy(file.binary.data() + 40, &nan, 4);
  EXPECT_MPC_ERROR(ReadRigGltf(dir.Write("a.glb", file.Bytes())), kBadFile, "not finite");
}

TEST(GltfWriteTest, AViewerShowsTheBonesAndVerticesOfThePerformance) {
  const TempDir dir;
  for (const TestRigOptions& shape : testing::TestRigVariants()) {
    for (const TestGltfOptions& options : testing::TestGltfVariants()) {
      TestGltf file(testing::MakeTestRig(shape), options);
      const auto source = dir.Write(options.data_uri ? "a.gltf" : "a.glb", file.Bytes());
      const RigAsset rig = ReadRigGltf(source);
      const GltfPerformance performance =
          RandomPerformance(rig, BuildCharacter(rig, MapRigByNames(rig)), 3);
      WriteGltfPerformance(dir / "out.glb", source, rig, performance);
      ExpectShown(GltfProbe(dir / "out.glb"), rig, performance);
    }
  }
}

TEST(GltfWriteTest, BonesThatMoveOrGrowInTheirParentsAreFollowed) {
  const TempDir dir;
  TestGltf file(testing::MakeTestRig(), {.armature = true});
  const auto source = dir.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  GltfPerformance performance = testing::RandomBonePerformance(rig, 5, 30);
  for (size_t f = 0; f < 5; ++f) {
    Eigen::Affine3d& moved = performance.scene_from_bone[f][3];
    moved.pretranslate(Eigen::Vector3d(0, 3e-4 * static_cast<double>(f), 0.1));
    performance.scene_from_bone[f][7].scale(1 + 0.1 * static_cast<double>(f));
  }
  WriteGltfPerformance(dir / "out.glb", source, rig, performance);
  ExpectShown(GltfProbe(dir / "out.glb"), rig, performance);
}

TEST(GltfWriteTest, OtherRestPoseAndOtherProportionsAreFollowed) {
  const TempDir dir;
  for (const TestGltfOptions& options :
       std::vector<TestGltfOptions>{{.moved_rest = true},
                                    {.armature = true, .moved_rest = true},
                                    {.matrix_nodes = true, .moved_rest = true}}) {
    for (const bool other_proportions : {false, true}) {
      TestGltf file(testing::MakeTestRig({.arm_down_rad = 0.8}), options);
      const auto source = dir.Write("a.glb", file.Bytes());
      RigAsset rig = ReadRigGltf(source);
      Character character = BuildCharacter(rig, MapRigByNames(rig));
      if (other_proportions) {
        Proportions proportions;
        proportions.overall = 1.1;
        proportions.part[static_cast<size_t>(BodyPart::kThigh)] = 1.2;
        ApplyProportions(proportions, &character, &rig);
      }
      const GltfPerformance performance = RandomPerformance(rig, character, 4);
      WriteGltfPerformance(dir / "out.glb", source, rig, performance);
      const GltfProbe probe(dir / "out.glb");
      ExpectShown(probe, rig, performance);
      if (!other_proportions) continue;
      // What was written reads back as the changed rig, standing in its bind pose.
      const RigAsset read = ReadRigGltf(dir / "out.glb");
      for (size_t b = 0; b < rig.bones.size(); ++b) {
        EXPECT_LT(BoneError(read.bones[b].scene_from_bone, rig.bones[b].scene_from_bone), 1e-5);
      }
      EXPECT_LT((read.meshes[0].mesh.positions - rig.meshes[0].mesh.positions).norm(), 1e-3f);
      Eigen::Matrix3Xf normals;
      VertexNormals(rig.meshes[0].mesh.positions, rig.meshes[0].mesh.triangles, &normals);
      Eigen::Matrix3Xd written =
          probe.Values(probe.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"]);
      if (options.armature) continue;  // the normals of that file are not in the mesh's frame
      EXPECT_LT((written - normals.cast<double>()).colwise().norm().maxCoeff(), 1e-3);
    }
  }
}

TEST(GltfWriteTest, KeepsTheSourceAndDropsItsAnimation) {
  const TempDir dir;
  for (const bool data_uri : {false, true}) {
    TestGltf file(testing::MakeTestRig(), {.old_animation = true, .data_uri = data_uri});
    const auto source = dir.Write(data_uri ? "a.gltf" : "a.glb", file.Bytes());
    const RigAsset rig = ReadRigGltf(source);
    const GltfPerformance performance =
        RandomPerformance(rig, BuildCharacter(rig, MapRigByNames(rig)), 3);
    WriteGltfPerformance(dir / "out.glb", source, rig, performance);
    const GltfProbe out(dir / "out.glb");
    for (const char* key : {"asset", "extensionsUsed", "materials", "textures", "samplers", "skins",
                            "nodes", "scenes"}) {
      if (std::string(key) == "skins") continue;  // the accessor's index may change
      EXPECT_EQ(out.json[key], file.json[key]) << key;
    }
    EXPECT_EQ(out.json["skins"][0]["extras"], file.json["skins"][0]["extras"]);
    EXPECT_EQ(out.json["skins"][0]["joints"], file.json["skins"][0]["joints"]);
    EXPECT_EQ(out.ViewBytes(out.json["images"][0]["bufferView"]),
              "\x89PNG\r\n\x1a\nnot a picture, but kept as it is");
    EXPECT_EQ(out.json["images"][0]["mimeType"], "image/png");
    ASSERT_EQ(out.json["animations"].size(), 1u);
    EXPECT_EQ(out.json["animations"][0]["name"], "performance");
    // The old animation's two accessors are gone: 1 time and 2 or 3 outputs per bone came.
    const size_t num_samplers = out.json["animations"][0]["samplers"].size();
    EXPECT_EQ(out.json["accessors"].size(), file.json["accessors"].size() - 2 + 1 + num_samplers);
    // The texture coordinates behind the old animation are still the mesh's.
    const RigAsset read = ReadRigGltf(dir / "out.glb");
    EXPECT_EQ(read.meshes[0].uv, rig.meshes[0].uv);
    EXPECT_EQ(read.meshes[0].mesh.positions, rig.meshes[0].mesh.positions);
  }
}

TEST(GltfWriteTest, KeysAreTheVideosAndQuaternionsDoNotJump) {
  const TempDir dir;
  TestGltf file(testing::MakeTestRig(), {});
  const auto source = dir.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  const Character character = BuildCharacter(rig, MapRigByNames(rig));
  const GltfPerformance performance = RandomPerformance(rig, character, 90);
  WriteGltfPerformance(dir / "out.glb", source, rig, performance);
  const GltfProbe out(dir / "out.glb");
  const auto& animation = out.json["animations"][0];
  int num_translations = 0;
  for (const auto& channel : animation["channels"]) {
    const auto& sampler = animation["samplers"][channel["sampler"].get<int>()];
    EXPECT_EQ(sampler["interpolation"], "LINEAR");
    const Eigen::MatrixXd times = out.Values(sampler["input"]);
    ASSERT_EQ(times.cols(), 90);
    for (int f = 0; f < 90; ++f) EXPECT_NEAR(times(f), performance.times_s[f], 1e-6);
    const std::string path = channel["target"]["path"];
    EXPECT_NE(path, "scale");
    num_translations += path == "translation";
    if (path != "rotation") continue;
    const Eigen::MatrixXd q = out.Values(sampler["output"]);
    EXPECT_LT((q.colwise().norm().array() - 1).abs().maxCoeff(), 1e-6);
    for (int f = 1; f < 90; ++f) EXPECT_GT(q.col(f).dot(q.col(f - 1)), 0.5);
  }
  // The hips move; the skeleton's other bones turn about fixed points of their parents, apart from
  // those where a rig has joints that the capture skeleton has not.
  EXPECT_GE(num_translations, 1);
  EXPECT_LT(num_translations, 8);
}

TEST(GltfWriteTest, AMovingCameraIsAnimated) {
  const TempDir dir;
  TestGltf file(testing::MakeTestRig(), {});
  const auto source = dir.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  GltfPerformance performance = RandomPerformance(rig, BuildCharacter(rig, MapRigByNames(rig)), 4);
  performance.camera = Camera::FromFov(640, 480, 1.0);
  performance.scene_from_camera.clear();
  for (int f = 0; f < 4; ++f) {
    performance.scene_from_camera.push_back(Eigen::Translation3d(0.3 * f, 1.2, 4) *
                                            Eigen::AngleAxisd(2.0 * f, Eigen::Vector3d::UnitY()));
  }
  WriteGltfPerformance(dir / "out.glb", source, rig, performance);
  const GltfProbe out(dir / "out.glb");
  for (int f = 0; f < 4; ++f) {
    const Eigen::Affine3d scene_from_node = out.NodeWorlds(f)[out.json["nodes"].size() - 1];
    const Eigen::Isometry3d& place = performance.scene_from_camera[static_cast<size_t>(f)];
    EXPECT_LT((scene_from_node.translation() - place.translation()).norm(), 1e-6);
    EXPECT_LT((scene_from_node.linear().col(2) + place.linear().col(2)).norm(), 1e-6);
    EXPECT_LT((scene_from_node.linear().col(1) + place.linear().col(1)).norm(), 1e-6);
  }
  performance.scene_from_camera.pop_back();
  EXPECT_MPC_ERROR(WriteGltfPerformance(dir / "out.glb", source, rig, performance),
                   kInvalidArgument, "3 places of the camera for 4 frames");
}

TEST(GltfWriteTest, CameraNodeSeesWhatTheCameraSees) {
  const TempDir dir;
  TestGltf file(testing::MakeTestRig(), {});
  const auto source = dir.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  GltfPerformance performance = RandomPerformance(rig, BuildCharacter(rig, MapRigByNames(rig)), 2);
  Camera camera = Camera::FromFov(640, 480, 1.0);
  camera.name = "cam";
  camera.fy *= 1.1;
  camera.distortion[0] = 0.01;
  performance.camera = camera;
  const Eigen::Isometry3d scene_from_camera =
      Eigen::Translation3d(0.3, 1.2, 4) *
      Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()) *
      Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY());
  performance.scene_from_camera = {scene_from_camera};
  WriteGltfPerformance(dir / "out.glb", source, rig, performance);
  const GltfProbe out(dir / "out.glb");
  const size_t node_index = out.json["nodes"].size() - 1;
  const auto& node = out.json["nodes"][node_index];
  EXPECT_EQ(out.json["scenes"][0]["nodes"].back(), node_index);
  EXPECT_EQ(node["extras"]["mpc_camera"]["fx"], camera.fx);
  EXPECT_EQ(node["extras"]["mpc_camera"]["dist"][0], 0.01);
  const auto& lens = out.json["cameras"][0]["perspective"];
  const double yfov = lens["yfov"];
  const double aspect = lens["aspectRatio"];
  const Eigen::Affine3d scene_from_node = out.NodeWorlds(-1)[node_index];
  camera.distortion = {};
  for (const Eigen::Vector3d& x : {Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(-0.4, 0.2, 0.5)}) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(Project(camera, scene_from_camera.inverse() * x, &pixel));
    // OpenGL's perspective: normalised device coordinates of the glTF camera.
    const Eigen::Vector3d p = scene_from_node.inverse() * x;
    ASSERT_LT(p.z(), 0);
    const double ndc_x = p.x() / -p.z() / (aspect * std::tan(yfov / 2));
    const double ndc_y = p.y() / -p.z() / std::tan(yfov / 2);
    EXPECT_NEAR((ndc_x + 1) / 2 * 640, pixel.x() + 640 / 2.0 - camera.cx, 1e-3);
    EXPECT_NEAR((1 - ndc_y) / 2 * 480, pixel.y() + 480 / 2.0 - camera.cy, 1e-3);
  }
}

TEST(GltfWriteTest, RefusesWhatCannotBeWritten) {
  const TempDir dir;
  TestGltf file(testing::MakeTestRig(), {});
  const auto source = dir.Write("a.glb", file.Bytes());
  const RigAsset rig = ReadRigGltf(source);
  const GltfPerformance good = RandomPerformance(rig, BuildCharacter(rig, MapRigByNames(rig)), 3);
  const auto write = [&](const std::function<void(GltfPerformance*)>& breaks) {
    GltfPerformance bad = good;
    breaks(&bad);
    WriteGltfPerformance(dir / "out.glb", source, rig, bad);
  };
  EXPECT_MPC_ERROR(write([](auto* p) { p->times_s.pop_back(); }), kInvalidArgument, "2 times");
  EXPECT_MPC_ERROR(write([](auto* p) { *p = {}; }), kInvalidArgument, "0 times");
  EXPECT_MPC_ERROR(write([](auto* p) { p->times_s[2] = p->times_s[1]; }), kInvalidArgument,
                   "frame 2");
  EXPECT_MPC_ERROR(write([](auto* p) { p->times_s[0] = -1; }), kInvalidArgument, "time -1");
  EXPECT_MPC_ERROR(write([](auto* p) { p->scene_from_bone[1].pop_back(); }), kInvalidArgument,
                   "frame 1");
  EXPECT_MPC_ERROR(write([](auto* p) { p->scene_from_bone[1][0](0, 3) = std::nan(""); }),
                   kInvalidArgument, "frame 1");
  EXPECT_FALSE(std::filesystem::exists(dir / "out.glb"));
  EXPECT_MPC_ERROR(WriteGltfPerformance("/dev/full", source, rig, good), kWriteFailed, "/dev/full");
  EXPECT_MPC_ERROR(WriteGltfPerformance(source / "out.glb", source, rig, good), kWriteFailed,
                   "out.glb");
  EXPECT_MPC_ERROR(WriteGltfPerformance(dir / "out.glb", dir / "no.glb", rig, good), kFileNotFound,
                   "no.glb");
  RigAsset other = rig;
  other.meshes[0].mesh.positions.conservativeResize(3, 5);
  EXPECT_MPC_ERROR(WriteGltfPerformance(dir / "out.glb", source, other, good), kMismatch,
                   "vertices");
}

}  // namespace
}  // namespace mpc
