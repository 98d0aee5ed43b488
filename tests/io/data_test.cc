// The files of the real data: every actor, motion, camera and detection file is read, and what it
// holds is what its README says.
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/core.hpp>

#include "io/gltf_probe.h"
#include "io/random_performance.h"
#include "io/temp_dir.h"
#include "mpc/io/bvh.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/gltf.h"
#include "mpc/io/video.h"
#include "support/data_dir.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

fs::path Data(const char* name) { return *testing::DataDir() / name; }

TEST(DataTest, ActorsStandUpright) {
  MPC_REQUIRE_DATA();
  const std::vector<std::tuple<const char*, size_t, double, double>> actors = {
      {"male_tpose.glb", 22, 1.70, 1.80},
      {"male_apose.glb", 22, 1.779, 1.781},
      {"male_apose_lod5k.glb", 22, 1.7, 1.8},
      {"female_apose.glb", 22, 1.659, 1.661},
      {"CesiumMan.glb", 19, 1.4, 1.6}};
  for (const auto& [name, num_bones, min_height, max_height] : actors) {
    SCOPED_TRACE(name);
    const RigAsset rig = ReadRigGltf(Data("actors") / name);
    EXPECT_EQ(rig.bones.size(), num_bones);
    ASSERT_EQ(rig.meshes.size(), 1u);
    const Eigen::Matrix3Xf& x = rig.meshes[0].mesh.positions;
    EXPECT_NEAR(x.row(1).minCoeff(), 0, 0.01);
    EXPECT_GT(x.row(1).maxCoeff(), min_height);
    EXPECT_LT(x.row(1).maxCoeff(), max_height);
    EXPECT_EQ(rig.meshes[0].uv.cols(), x.cols());
    EXPECT_TRUE(CheckWeights(rig).empty());
    // Bones lie inside the mesh's box, and only one of them is a root.
    int num_roots = 0;
    for (const RigBone& bone : rig.bones) {
      num_roots += bone.parent < 0;
      const Eigen::Vector3f origin = bone.scene_from_bone.translation().cast<float>();
      EXPECT_TRUE((origin.array() > x.rowwise().minCoeff().array() - 0.05f).all()) << bone.name;
      EXPECT_TRUE((origin.array() < x.rowwise().maxCoeff().array() + 0.05f).all()) << bone.name;
    }
    EXPECT_EQ(num_roots, 1);
  }
}

// The bones a viewer shows are the performance's, and all that is not animation is the source's.
TEST(DataTest, WrittenPerformancesKeepTheActor) {
  MPC_REQUIRE_DATA();
  const testing::TempDir dir;
  for (const auto& entry : fs::directory_iterator(Data("actors"))) {
    if (entry.path().extension() != ".glb") continue;
    SCOPED_TRACE(entry.path().filename().string());
    const RigAsset rig = ReadRigGltf(entry.path());
    const GltfPerformance performance = testing::RandomBonePerformance(rig, 5, 60);
    WriteGltfPerformance(dir / "out.glb", entry.path(), rig, performance);
    const testing::GltfProbe before(entry.path());
    const testing::GltfProbe after(dir / "out.glb");
    for (const char* key :
         {"asset", "scene", "scenes", "nodes", "materials", "textures", "samplers"}) {
      EXPECT_EQ(after.json[key], before.json[key]) << key;
    }
    for (size_t i = 0; i < before.json["images"].size(); ++i) {
      EXPECT_EQ(after.ViewBytes(after.json["images"][i]["bufferView"]),
                before.ViewBytes(before.json["images"][i]["bufferView"]));
    }
    const RigAsset read = ReadRigGltf(dir / "out.glb");
    EXPECT_EQ(read.meshes[0].mesh.positions, rig.meshes[0].mesh.positions);
    EXPECT_EQ(read.meshes[0].weights, rig.meshes[0].weights);
    for (int f = 0; f < 5; ++f) {
      const std::vector<Eigen::Affine3d> worlds = after.NodeWorlds(f);
      for (size_t b = 0; b < rig.bones.size(); ++b) {
        EXPECT_LT((worlds[rig.bones[b].node].translation() -
                   performance.scene_from_bone[f][b].translation())
                      .norm(),
                  1e-4);
      }
    }
  }
}

TEST(DataTest, VideosHaveTheirFrames) {
  MPC_REQUIRE_DATA();
  const std::vector<std::tuple<const char*, int, int, double, int>> videos = {
      {"pose2sim/cam01.mp4", 1080, 1920, 60, 100},
      {"pose2sim/cam03.mp4", 1088, 1920, 60, 100},
      {"video/pose_squats.mp4", 720, 1280, 5, 65}};
  for (const auto& [name, width, height, fps, num_frames] : videos) {
    SCOPED_TRACE(name);
    VideoReader reader(Data(name));
    EXPECT_EQ(reader.width(), width);
    EXPECT_EQ(reader.height(), height);
    cv::Mat frame;
    int count = 0;
    for (; reader.Read(&frame); ++count) {
      EXPECT_NEAR(reader.frame_time_s(), count / fps, 1e-3);
    }
    EXPECT_EQ(count, num_frames);
  }
}

TEST(DataTest, MotionsHaveHumanSize) {
  MPC_REQUIRE_DATA();
  int num_files = 0;
  for (const auto& entry : fs::directory_iterator(Data("mocap"))) {
    SCOPED_TRACE(entry.path().filename().string());
    const BvhMotion motion = ReadBvh(entry.path());
    ++num_files;
    EXPECT_GT(motion.joints.size(), 10u);
    for (const int frame : {0, motion.num_frames() / 2, motion.num_frames() - 1}) {
      const Eigen::Matrix3Xd x = BvhJointPositions(motion, frame);
      const double extent = (x.rowwise().maxCoeff() - x.rowwise().minCoeff()).maxCoeff();
      EXPECT_GT(extent, 70);
      EXPECT_LT(extent, 230);
    }
  }
  EXPECT_EQ(num_files, 6);
}

TEST(DataTest, CamerasSeeTheMan) {
  MPC_REQUIRE_DATA();
  const fs::path file = Data("pose2sim/cameras.json");
  EXPECT_EQ(ReadCameras(file).size(), 2u);
  const Camera camera = ReadCamera(file.string() + ":cam03");
  EXPECT_EQ(camera.width, 1088);
  ASSERT_TRUE(camera.has_extrinsics);
  // The beam spans x = -2..0 at the origin: its middle is in the picture.
  Eigen::Vector2d pixel;
  ASSERT_TRUE(Project(camera, camera.camera_from_world * Eigen::Vector3d(-1, 0, 0), &pixel));
  EXPECT_TRUE(pixel.x() > 0 && pixel.x() < 1088 && pixel.y() > 0 && pixel.y() < 1920) << pixel;
}

TEST(DataTest, TwoDetectorsAgree) {
  MPC_REQUIRE_DATA();
  for (const std::string camera : {"cam01", "cam03"}) {
    SCOPED_TRACE(camera);
    const Detections2d open_pose =
        ReadDetections2d(Data("pose2sim") / (camera + "_openpose_body25b.json"));
    const Detections2d blaze_pose =
        ReadDetections2d(Data("pose2sim") / (camera + "_blazepose.json"));
    const Detections3d blaze_pose_3d =
        ReadDetections3d(Data("pose2sim") / (camera + "_blazepose.json"));
    ASSERT_EQ(open_pose.frames.size(), 100u);
    ASSERT_EQ(blaze_pose.frames.size(), 100u);
    ASSERT_EQ(blaze_pose_3d.frames.size(), 100u);
    EXPECT_TRUE(blaze_pose_3d.ray_aligned);
    EXPECT_EQ(open_pose.frames[0].confidence.maxCoeff(), 0);
    for (int id = 0; id < kNumPaperJoints; ++id) {
      const auto joint = static_cast<JointId>(id);
      const int a = FindColumn(open_pose.joints, joint);
      const int b = FindColumn(blaze_pose.joints, joint);
      ASSERT_GE(a, 0) << JointName(joint);
      ASSERT_GE(b, 0) << JointName(joint);
      std::vector<double> distances;
      for (size_t f = 0; f < 100; ++f) {
        if (open_pose.frames[f].confidence[a] < 0.3) continue;
        distances.push_back(
            (open_pose.frames[f].pixels.col(a) - blaze_pose.frames[f].pixels.col(b)).norm());
      }
      ASSERT_GT(distances.size(), 50u) << JointName(joint);
      std::nth_element(distances.begin(), distances.begin() + distances.size() / 2,
                       distances.end());
      // Joint definitions differ; sides swapped would be hundreds of pixels.
      EXPECT_LT(distances[distances.size() / 2], 40) << JointName(joint);
    }
  }
}

}  // namespace
}  // namespace mpc
