// The command with nothing but a video: the networks find the actor that the program draws itself,
// and the capture needs neither detections nor a camera.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "detect/models_dir.h"
#include "io/run_program.h"
#include "io/temp_dir.h"
#include "mpc/eval/metrics.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/gltf.h"
#include "mpc/io/joint_truth_file.h"
#include "mpc/io/rig_gltf.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;
using testing::RunProgram;

const std::string kCommand = std::string(MPC_COMMAND) + " ";

// The demo's clip, shorter and with fewer frames.
class NetworksTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new testing::TempDir;
    made_ = RunProgram(kCommand + "synth -o " + (*folder_ / "clip").string() +
                       " --outfit skirt --seconds 2 --fps 10 --samples 1 --noise off --quiet");
  }
  static void TearDownTestSuite() { delete folder_; }
  void SetUp() override { ASSERT_EQ(made_.status, 0) << made_.output; }

  static fs::path Clip(const std::string& name) { return *folder_ / "clip" / name; }
  static fs::path Output(const std::string& name) { return *folder_ / name; }

 private:
  inline static testing::TempDir* folder_ = nullptr;
  inline static testing::ProgramResult made_;
};

TEST_F(NetworksTest, FindTheActorInAlmostEveryFrame) {
  MPC_REQUIRE_MODELS();
  const fs::path output = Output("detected");
  const testing::ProgramResult run = RunProgram(kCommand + "detect " + Clip("clip.mp4").string() +
                                                " --detect-every 1 --quiet -o " + output.string());
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_TRUE(fs::exists(output / "overlay.mp4"));
  EXPECT_TRUE(fs::exists(output / "detections3d.json"));
  const Detections2d found = ReadDetections2d(output / "detections2d.json");
  int num_seen = 0;
  for (const Detections2d::Frame& frame : found.frames) num_seen += frame.confidence.sum() > 0;
  EXPECT_EQ(found.frames.size(), 20u);
  EXPECT_GE(num_seen, 0.95 * static_cast<double>(found.frames.size()));

  const Camera camera = ReadCamera(Clip("camera.json").string());
  JointTrack truth = ReadJointTrack(Clip("truth.trc"));
  for (Eigen::Index f = 0; f < truth.positions.cols(); ++f) {
    for (Eigen::Index j = 0; j < truth.positions.rows(); j += 3) {
      const Eigen::Vector3d x = truth.positions.block<3, 1>(j, f);
      truth.positions.block<3, 1>(j, f) =
          camera.camera_from_world.rotation * x + camera.camera_from_world.translation;
    }
  }
  const auto joints = ScoredJoints14();
  const ReprojectionError error = CompareReprojection(
      camera, joints, SelectJoints(truth.positions, truth.joints, joints), found);
  std::printf("joints lie %.1f px from the truth (%d of them)\n", error.mean_px,
              error.num_observations);
  EXPECT_LT(error.mean_px, 20);
}

TEST_F(NetworksTest, CaptureNeedsOnlyVideoAndActor) {
  MPC_REQUIRE_MODELS();
  const fs::path output = Output("take");
  const testing::ProgramResult run = RunProgram(
      kCommand + "capture " + Clip("clip.mp4").string() + " --actor " + Clip("actor.glb").string() +
      " --detect-every 4 --no-masks --no-overlay --quiet -o " + output.string());
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_NE(run.output.find("the focal length was estimated"), std::string::npos) << run.output;
  for (const char* name : {"performance.glb", "motion.bvh", "joints.trc", "detections2d.json"}) {
    EXPECT_TRUE(fs::exists(output / name)) << name;
  }
  std::ifstream file(output / "report.json");
  const nlohmann::json report = nlohmann::json::parse(file);
  EXPECT_TRUE(report["complete"]);
  EXPECT_GT(report["camera"]["focal_uncertainty"], 0.02);
  EXPECT_LT(report["camera"]["focal_uncertainty"], 0.31);
  EXPECT_FALSE(report["camera"].contains("focal_35mm"));
  EXPECT_EQ(report["person_iou"]["frames"], 6);  // 0, 4, ... 16 and the last
  EXPECT_GT(report["person_iou"]["mean"], 0.6);
}

// An actor with this skeleton, but thinner than any person.
TEST_F(NetworksTest, SaysThatTheActorDoesNotCoverThePerson) {
  MPC_REQUIRE_MODELS();
  RigAsset rig = ReadRigGltf(Clip("actor.glb"));
  for (RigMesh& part : rig.meshes) {
    part.mesh.positions.row(0) *= 0.3F;
    part.mesh.positions.row(2) *= 0.3F;
  }
  WriteRigGltf(Output("thin.glb"), rig);
  const testing::ProgramResult run =
      RunProgram(kCommand + "capture " + Clip("clip.mp4").string() + " --actor " +
                 Output("thin.glb").string() + " --camera " + Clip("camera.json").string() +
                 " --detect-every 8 --no-masks --no-overlay --quiet -o " + Output("thin").string());
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_NE(run.output.find("warning: the posed actor covers the person badly"), std::string::npos)
      << run.output;
}

// Without the networks the message says what to do.
TEST_F(NetworksTest, SaysHowToGetThem) {
  for (const std::string& command :
       {std::string("detect"), "capture --actor " + Clip("actor.glb").string()}) {
    const testing::ProgramResult run =
        RunProgram(kCommand + command + " " + Clip("clip.mp4").string() + " --models " +
                   Output("nowhere").string() + " -o " + Output("no_models").string());
    EXPECT_NE(run.status, 0);
    EXPECT_NE(run.output.find("run scripts/get_models.sh"), std::string::npos) << run.output;
    EXPECT_FALSE(fs::exists(Output("no_models") / "report.json"));
  }
}

}  // namespace
}  // namespace mpc
