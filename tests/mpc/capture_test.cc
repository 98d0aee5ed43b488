#include "mpc/capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "io/gltf_probe.h"
#include "io/run_program.h"
#include "io/temp_dir.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/bvh.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/trc.h"
#include "mpc/io/video.h"
#include "mpc/io/video_lens.h"
#include "mpc/mpc.h"
#include "small_clip.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::SmallClip;
using testing::TempDir;
using ::testing::UnorderedElementsAre;

constexpr double kExactM = 1e-4;  // what another reading of the files may differ

std::set<std::string> FilesIn(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    names.insert(entry.path().filename().string());
  }
  return names;
}

nlohmann::json ReadReport(const fs::path& folder) {
  return nlohmann::json::parse(ReadFile(folder / "report.json"));
}

// One clip for all tests; each captures into its own folder.
class CaptureTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { clip_ = new SmallClip(); }
  static void TearDownTestSuite() { delete clip_; }

  static CaptureOptions QuickOptions() {
    CaptureOptions options;
    options.pose.num_threads = 1;
    options.overlay = false;
    options.masks = false;
    return options;
  }

  static const SmallClip* clip_;
  TempDir out_;
};
const SmallClip* CaptureTest::clip_ = nullptr;

TEST_F(CaptureTest, WritesAllFilesAndACompleteReport) {
  Capture capture(clip_->inputs, out_ / "take");
  const CaptureReport report = capture.Run();
  EXPECT_TRUE(report.complete);
  EXPECT_THAT(FilesIn(out_ / "take"),
              UnorderedElementsAre("performance.glb", "motion.bvh", "joints.trc", "poses.json",
                                   "masks.mp4", "surface.pc2", "overlay.mp4", "report.json"));

  const nlohmann::json json = ReadReport(out_ / "take");
  EXPECT_EQ(json["format"], "mpc-report");
  EXPECT_EQ(json["version"], 1);
  EXPECT_EQ(json["complete"], true);
  EXPECT_EQ(json["fps"], SmallClip::kFps);
  EXPECT_EQ(json["num_frames"], clip_->num_frames);
  EXPECT_EQ(json["camera"]["name"], "small");
  EXPECT_EQ(json["mapping"]["parts"]["left_hand"], "leftHand");
  EXPECT_TRUE(json["proportions"]["parts"]["thigh"]["uncertainty"].is_number());
  for (const char* stage : {"video", "pose", "world", "files", "refinement"}) {
    EXPECT_TRUE(json["seconds"][stage].is_number()) << stage;
    EXPECT_TRUE(json["core_seconds"][stage].is_number()) << stage;
  }
  const size_t num_joints = json["joints"].size();
  EXPECT_GE(num_joints, size_t{kNumPaperJoints});
  ASSERT_EQ(json["frames"].size(), static_cast<size_t>(clip_->num_frames));
  for (const nlohmann::json& frame : json["frames"]) {
    EXPECT_EQ(frame["state"], "tracked");
    EXPECT_LT(frame["residual_px"], 5);
    EXPECT_TRUE(frame["silhouette"]["state"].is_string());
    EXPECT_TRUE(frame["silhouette"]["model_iou"].is_number());
    for (const char* quantity : {"state", "residual_px", "confidence"}) {
      EXPECT_EQ(frame["joints"][quantity].size(), num_joints);
    }
  }

  VideoReader overlay(out_ / "take" / "overlay.mp4");
  EXPECT_EQ(overlay.width(), SmallClip::kWidth);
  EXPECT_EQ(overlay.height(), SmallClip::kHeight);
  EXPECT_EQ(overlay.fps(), SmallClip::kFps);
  EXPECT_EQ(overlay.num_frames(), clip_->num_frames);
}

TEST_F(CaptureTest, TheReportSaysHowThePosesWereMade) {
  CaptureOptions options = QuickOptions();
  options.pose = PoseOptions::Paper();
  options.pose.cutoff_hz = 3;
  Capture(clip_->inputs, out_.path(), options).Run();
  const nlohmann::json pose = ReadReport(out_.path())["options"]["pose"];
  EXPECT_EQ(pose["basis_size"], 8);
  EXPECT_EQ(pose["weight_smooth"], 50);
  EXPECT_EQ(pose["cutoff_hz"], 3);
  EXPECT_EQ(pose["fit_proportions"], false);
  EXPECT_EQ(pose["anisotropic_3d"], false);
}

TEST_F(CaptureTest, FindsTheMotion) {
  Capture capture(clip_->inputs, out_.path(), QuickOptions());
  const CaptureReport report = capture.Run();
  const MarkerTrajectories markers = ReadTrc(out_ / "joints.trc");
  EXPECT_EQ(markers.fps, SmallClip::kFps);
  ASSERT_EQ(markers.num_frames(), clip_->num_frames);
  const CameraFromWorld& camera = clip_->camera.camera_from_world;
  double sum_m = 0;
  int count = 0;
  for (size_t i = 0; i < clip_->detections.joints.size(); ++i) {
    const std::string name(JointName(clip_->detections.joints[i]));
    const auto found = std::find(markers.names.begin(), markers.names.end(), name);
    ASSERT_NE(found, markers.names.end()) << name;
    const auto m = static_cast<Eigen::Index>(found - markers.names.begin());
    for (int f = 0; f < clip_->num_frames; ++f) {
      const Eigen::Vector3d world = markers.positions.block<3, 1>(3 * m, f);
      const Eigen::Vector3d truth =
          clip_->detections.truth.block<3, 1>(static_cast<Eigen::Index>(3 * i), f);
      // Depth along the ray is known only up to the person's size: compare directions.
      sum_m += ((camera * world).normalized() - truth.normalized()).norm() * truth.norm();
      ++count;
    }
  }
  EXPECT_LT(sum_m / count, 0.03);
  EXPECT_TRUE(report.track.poses.allFinite());
}

TEST_F(CaptureTest, GltfAndBvhShowTheJointsOfTheTrc) {
  Capture capture(clip_->inputs, out_.path(), QuickOptions());
  const CaptureReport report = capture.Run();
  const MarkerTrajectories markers = ReadTrc(out_ / "joints.trc");
  const testing::GltfProbe glb(out_ / "performance.glb");
  const BvhMotion bvh = ReadBvh(out_ / "motion.bvh");
  ASSERT_EQ(bvh.num_frames(), clip_->num_frames);
  const auto& times = glb.json["animations"][0]["samplers"][0]["input"];
  ASSERT_EQ(glb.Values(times).cols(), clip_->num_frames);
  EXPECT_NEAR(glb.Values(times)(0, 10), 10 / SmallClip::kFps, 1e-6);

  struct Place {
    const char* marker;
    const char* bone;     // of the rig
    const char* segment;  // of the BVH
  };
  const std::vector<Place> places = {{"left_shoulder", "leftUpperArm", "left_upper_arm"},
                                     {"left_elbow", "leftLowerArm", "left_forearm"},
                                     {"right_elbow", "rightLowerArm", "right_forearm"},
                                     {"left_hip", "leftUpperLeg", "left_thigh"},
                                     {"right_knee", "rightLowerLeg", "right_shank"},
                                     {"left_ankle", "leftFoot", "left_foot"},
                                     {"right_ankle", "rightFoot", "right_foot"}};
  const auto node_of = [&](const std::string& name) {
    for (size_t n = 0; n < glb.json["nodes"].size(); ++n) {
      if (glb.json["nodes"][n].value("name", "") == name) return static_cast<int>(n);
    }
    return -1;
  };
  for (int f = 0; f < clip_->num_frames; f += 5) {
    const std::vector<Eigen::Affine3d> nodes = glb.NodeWorlds(f);
    const Eigen::Matrix3Xd segments = BvhJointPositions(bvh, f);
    for (const Place& place : places) {
      const auto found = std::find(markers.names.begin(), markers.names.end(), place.marker);
      ASSERT_NE(found, markers.names.end()) << place.marker;
      const Eigen::Vector3d in_world = markers.positions.block<3, 1>(
          3 * static_cast<Eigen::Index>(found - markers.names.begin()), f);
      const Eigen::Vector3d in_scene = report.world.scene_from_world * in_world;
      const int node = node_of(place.bone);
      ASSERT_GE(node, 0) << place.bone;
      EXPECT_LT((nodes[static_cast<size_t>(node)].translation() - in_scene).norm(), kExactM)
          << place.bone << " frame " << f;
      const int segment = bvh.FindJoint(place.segment);
      ASSERT_GE(segment, 0) << place.segment;
      EXPECT_LT((segments.col(segment) - in_scene).norm(), kExactM)
          << place.segment << " frame " << f;
    }
  }
}

TEST_F(CaptureTest, BytesDoNotDependOnTheNumberOfThreads) {
  for (const int num_threads : {1, 3}) {
    CaptureOptions options = QuickOptions();
    options.pose.num_threads = num_threads;
    options.masks = true;
    Capture(clip_->inputs, out_ / std::to_string(num_threads), options).Run();
  }
  for (const char* name :
       {"performance.glb", "motion.bvh", "joints.trc", "poses.json", "masks.mp4"}) {
    EXPECT_EQ(ReadFile(out_ / "1" / name), ReadFile(out_ / "3" / name)) << name;
  }
}

TEST_F(CaptureTest, RunTwiceGivesTheSame) {
  Capture capture(clip_->inputs, out_.path(), QuickOptions());
  capture.Run();
  const std::string first = ReadFile(out_ / "performance.glb");
  capture.Run();
  EXPECT_EQ(ReadFile(out_ / "performance.glb"), first);
}

TEST_F(CaptureTest, StoppedInThePoseStageKeepsWhatIsThere) {
  Capture capture(clip_->inputs, out_.path());
  const CaptureReport report =
      capture.Run([](const Progress& progress) { return progress.stage != "pose"; });
  EXPECT_FALSE(report.complete);
  EXPECT_TRUE(report.track.poses.allFinite());
  EXPECT_THAT(FilesIn(out_.path()),
              UnorderedElementsAre("performance.glb", "motion.bvh", "joints.trc", "poses.json",
                                   "report.json"));
  EXPECT_EQ(ReadReport(out_.path())["complete"], false);
}

TEST_F(CaptureTest, StoppedInTheRefinementLeavesTheMotion) {
  Capture capture(clip_->inputs, out_.path());
  capture.Run();
  const CaptureReport report =
      capture.Run([](const Progress& progress) { return progress.stage != "refinement"; });
  EXPECT_FALSE(report.complete);
  EXPECT_THAT(FilesIn(out_.path()),
              UnorderedElementsAre("performance.glb", "motion.bvh", "joints.trc", "poses.json",
                                   "report.json"));
  EXPECT_EQ(ReadReport(out_.path())["complete"], false);
}

// White frames in place of the stage: the files and the report say so.
TEST_F(CaptureTest, MasksCanBeGiven) {
  CaptureInputs inputs = clip_->inputs;
  inputs.masks = inputs.true_masks = out_ / "white";
  MaskFolderWriter writer(inputs.masks);
  for (int f = 0; f < clip_->num_frames; ++f) {
    writer.Write(cv::Mat(SmallClip::kHeight, SmallClip::kWidth, CV_8UC1, cv::Scalar(255)));
  }
  writer.Close();
  const CaptureReport report = Capture(inputs, out_ / "take").Run();
  ASSERT_EQ(report.refinement.size(), static_cast<size_t>(clip_->num_frames));
  for (const RefinementRecord& record : report.refinement) {
    EXPECT_EQ(record.silhouette.state, SilhouetteState::kExternal);
    EXPECT_EQ(record.silhouette.true_iou, 1);
    // A mask without an outline inside the picture says nothing.
    EXPECT_EQ(record.pose_state, RefinementState::kNoSilhouette);
    EXPECT_EQ(record.surface_state, RefinementState::kNoSilhouette);
  }
  const nlohmann::json json = ReadReport(out_ / "take");
  EXPECT_EQ(json["frames"][3]["silhouette"]["state"], "external");
  EXPECT_EQ(json["true_iou"]["silhouettes"]["mean"], 1);
  EXPECT_LT(json["true_iou"]["model"]["mean"], 0.5);
  EXPECT_EQ(json["frames"][3]["refinement"]["pose"], "no silhouette");
  EXPECT_EQ(json["inputs"]["masks"], inputs.masks.string());
  MaskReader masks(out_ / "take" / "masks.mp4", SmallClip::kWidth, SmallClip::kHeight);
  cv::Mat mask;
  ASSERT_TRUE(masks.Read(&mask));
  EXPECT_EQ(cv::countNonZero(mask), mask.rows * mask.cols);
}

TEST_F(CaptureTest, MasksMustBeOfThisVideo) {
  for (const bool given : {true, false}) {
    CaptureInputs inputs = clip_->inputs;
    (given ? inputs.masks : inputs.true_masks) = out_ / "masks";
    EXPECT_MPC_ERROR(Capture(inputs, out_ / "take"), kFileNotFound, "masks");
    const auto write = [&](int width, int height, int count) {
      MaskFolderWriter writer(out_ / "masks");
      for (int f = 0; f < count; ++f) writer.Write(cv::Mat::zeros(height, width, CV_8UC1));
      writer.Close();
    };
    write(SmallClip::kHeight, SmallClip::kWidth, clip_->num_frames);
    EXPECT_MPC_ERROR(Capture(inputs, out_ / "take"), kMismatch, "160 x 128");
    write(SmallClip::kWidth, SmallClip::kHeight, clip_->num_frames - 3);
    EXPECT_MPC_ERROR(Capture(inputs, out_ / "take"), kMismatch, "masks has 21 frames");
    fs::remove_all(out_ / "masks");
  }
  EXPECT_FALSE(fs::exists(out_ / "take"));
}

TEST_F(CaptureTest, StoppedInTheRefinementLeavesNoHalfVideo) {
  Capture capture(clip_->inputs, out_.path());
  capture.Run();
  const CaptureReport report = capture.Run([](const Progress& progress) {
    return progress.stage != "refinement" || progress.step < progress.num_steps;
  });
  EXPECT_FALSE(report.complete);
  EXPECT_THAT(FilesIn(out_.path()),
              UnorderedElementsAre("performance.glb", "motion.bvh", "joints.trc", "poses.json",
                                   "report.json"));
}

TEST_F(CaptureTest, StoppedInTheOverlayLeavesNoHalfVideo) {
  CaptureOptions options;
  options.masks = false;
  Capture capture(clip_->inputs, out_.path(), options);
  EXPECT_TRUE(capture.Run().complete);
  EXPECT_TRUE(fs::exists(out_ / "overlay.mp4"));
  const CaptureReport report =
      capture.Run([](const Progress& progress) { return progress.stage != "overlay"; });
  EXPECT_FALSE(report.complete);
  EXPECT_THAT(FilesIn(out_.path()),
              UnorderedElementsAre("performance.glb", "motion.bvh", "joints.trc", "poses.json",
                                   "report.json"));
  EXPECT_EQ(ReadReport(out_.path())["complete"], false);
}

TEST_F(CaptureTest, StoppedBeforeAnythingWasFinishedWritesNothing) {
  Capture capture(clip_->inputs, out_.path());
  EXPECT_MPC_ERROR(capture.Run([](const Progress&) { return false; }), kCancelled, "stopped");
  EXPECT_TRUE(FilesIn(out_.path()).empty());
}

TEST_F(CaptureTest, ProgressCountsEveryStageToItsEnd) {
  std::map<std::string, Progress> last;
  Capture(clip_->inputs, out_.path()).Run([&](const Progress& progress) {
    EXPECT_GE(progress.step, last[std::string(progress.stage)].step);
    last[std::string(progress.stage)] = progress;
    return true;
  });
  EXPECT_EQ(last.size(), 5u);
  for (const char* stage : {"video", "start", "proportions", "pose", "refinement"}) {
    EXPECT_EQ(last[stage].step, last[stage].num_steps) << stage;
    EXPECT_GT(last[stage].num_steps, 0) << stage;
  }
}

TEST_F(CaptureTest, WithoutExtrinsicsTheTrcStandsInTheScene) {
  CaptureInputs inputs = clip_->inputs;
  inputs.camera.clear();
  inputs.fov_rad = 0.9;
  const CaptureReport report = Capture(inputs, out_.path(), QuickOptions()).Run();
  EXPECT_TRUE(report.world.scene_from_world.rotation.isIdentity(0));
  const MarkerTrajectories markers = ReadTrc(out_ / "joints.trc");
  const auto row_of = [&](const char* name) {
    return 3 *
           (std::find(markers.names.begin(), markers.names.end(), name) - markers.names.begin());
  };
  const Eigen::VectorXd toe_y = markers.positions.row(row_of("left_toe") + 1);
  const Eigen::VectorXd head_y = markers.positions.row(row_of("head_top") + 1);
  EXPECT_NEAR(toe_y.mean(), 0.05, 0.1);
  EXPECT_GT(head_y.mean(), 1.2);
}

TEST_F(CaptureTest, ARigInCentimetresNeedsItsHeightAndThenWorks) {
  RigAsset large = clip_->rig;
  for (RigBone& bone : large.bones) {
    bone.scene_from_bone = Eigen::Scaling(100.0) * bone.scene_from_bone;
  }
  for (RigMesh& mesh : large.meshes) mesh.mesh.positions *= 100;
  CaptureInputs inputs = clip_->inputs;
  inputs.actor = out_ / "large.glb";
  WriteRigGltf(inputs.actor, large);
  EXPECT_MPC_ERROR(Capture(inputs, out_ / "take", QuickOptions()), kUnsupported, "height");

  const auto heights = clip_->character.mesh.positions.row(1);
  CaptureOptions options = QuickOptions();
  options.height_m = static_cast<double>(heights.maxCoeff() - heights.minCoeff());
  const CaptureReport scaled = Capture(inputs, out_ / "scaled", options).Run();
  EXPECT_NEAR(scaled.height_scale, 0.01, 1e-6);
  Capture(clip_->inputs, out_ / "metres", QuickOptions()).Run();
  const Eigen::MatrixXd difference = ReadTrc(out_ / "scaled" / "joints.trc").positions -
                                     ReadTrc(out_ / "metres" / "joints.trc").positions;
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-3);
}

TEST_F(CaptureTest, ACameraForAnotherSizeIsScaledOrRefused) {
  CaptureInputs inputs = clip_->inputs;
  inputs.camera = (out_ / "camera.json").string();
  WriteCameras(inputs.camera, {clip_->camera.ScaledTo(256, 320)});
  const CaptureReport report = Capture(inputs, out_ / "take", QuickOptions()).Run();
  EXPECT_NEAR(report.camera.fx, clip_->camera.fx, 1e-9);
  EXPECT_THAT(report.warnings, Contains(HasSubstr("was scaled")));

  WriteCameras(inputs.camera, {testing::SmallCamera(160, 128)});
  EXPECT_MPC_ERROR(Capture(inputs, out_ / "take", QuickOptions()), kMismatch, "160 x 128");
}

// As a telephone writes it: the 35 mm equivalent of the lens in the video's metadata.
TEST_F(CaptureTest, TheFocalLengthStartsFromTheVideosMetadata) {
  const Camera& truth = clip_->camera;
  const double focal_35mm =
      std::round(truth.fx / FocalPxFrom35mm(1, SmallClip::kWidth, SmallClip::kHeight));
  CaptureInputs inputs = clip_->inputs;
  inputs.video = out_ / "telephone.mov";
  const testing::ProgramResult made =
      testing::RunProgram("ffmpeg -i " + clip_->inputs.video.string() +
                          " -c copy -movflags use_metadata_tags -metadata "
                          "com.apple.quicktime.camera.focal_length.35mm_equivalent=" +
                          std::to_string(std::lround(focal_35mm)) + " " + inputs.video.string());
  if (made.status != 0) GTEST_SKIP() << "needs ffmpeg";
  inputs.camera.clear();
  const CaptureReport report = Capture(inputs, out_ / "take", QuickOptions()).Run();
  EXPECT_EQ(report.focal_35mm, focal_35mm);
  EXPECT_NEAR(report.camera.fx, truth.fx, 0.1 * truth.fx);
  EXPECT_LT(report.focal_uncertainty, 0.15);
  EXPECT_EQ(ReadReport(out_ / "take")["camera"]["focal_35mm"], focal_35mm);
  EXPECT_THAT(report.warnings, Contains(HasSubstr("the focal length was estimated")));
}

// The same clip as if the camera had turned about the person: in the camera nothing changes, in the
// world the person turns the other way, and the files agree with one another.
TEST_F(CaptureTest, AMovingCameraIsPutIntoTheWorldFrameByFrame) {
  CaptureInputs inputs = clip_->inputs;
  std::vector<CameraFromWorld> motion;
  for (int f = 0; f < 24; ++f) {
    CameraFromWorld place = clip_->camera.camera_from_world;
    place.rotation = place.rotation * ExpSO3({0, 0.02 * f, 0});
    motion.push_back(place);
  }
  inputs.camera = (out_ / "camera.json").string();
  WriteMovingCamera(inputs.camera, clip_->camera, motion);
  CaptureOptions options = QuickOptions();
  options.pose.hold_standing_feet = false;  // which depends on the world
  const CaptureReport moving = Capture(inputs, out_ / "moving", options).Run();
  const CaptureReport standing = Capture(clip_->inputs, out_ / "standing", options).Run();
  EXPECT_EQ(moving.track.poses, standing.track.poses);
  const Eigen::MatrixXd in_moving = ReadTrc(out_ / "moving" / "joints.trc").positions;
  const Eigen::MatrixXd in_standing = ReadTrc(out_ / "standing" / "joints.trc").positions;
  ASSERT_EQ(in_moving.cols(), 24);
  for (const int f : {0, 11, 23}) {
    const Rigid<WorldFrame, WorldFrame> turned =
        motion[static_cast<size_t>(f)].Inverse() * clip_->camera.camera_from_world;
    for (int i = 0; i < in_moving.rows(); i += 3) {
      EXPECT_LT((in_moving.block<3, 1>(i, f) - turned * in_standing.block<3, 1>(i, f)).norm(),
                1e-3);
    }
  }
  const nlohmann::json json = ReadReport(out_ / "moving");
  EXPECT_TRUE(json["world"]["moving_camera"]);
  EXPECT_EQ(json["frames"][5]["world_from_camera"]["R"].size(), 3u);
  const testing::GltfProbe probe(out_ / "moving" / "performance.glb");
  const auto& camera_node = probe.json["nodes"].back();
  EXPECT_TRUE(camera_node.contains("camera"));

  motion.pop_back();
  WriteMovingCamera(inputs.camera, clip_->camera, motion);
  EXPECT_MPC_ERROR(Capture(inputs, out_ / "take", QuickOptions()), kMismatch, "has 23 frames");
}

TEST_F(CaptureTest, DetectionsMustBeOfThisVideo) {
  CaptureInputs inputs = clip_->inputs;
  inputs.detections2d = out_ / "detections2d.json";
  inputs.detections3d = out_ / "detections3d.json";

  Detections2d short2d = clip_->detections.detections2d;
  short2d.frames.resize(20);
  WriteDetections(inputs.detections2d, short2d);
  WriteDetections(inputs.detections3d, clip_->detections.detections3d);
  EXPECT_MPC_ERROR(Capture(inputs, out_ / "take", QuickOptions()), kMismatch,
                   "has 24 frames");  // the 3D against the 2D detections
  inputs.detections3d.clear();
  Capture without_3d(inputs, out_ / "take", QuickOptions());
  EXPECT_MPC_ERROR(without_3d.Run(), kMismatch, "has 20 frames");

  Detections2d other_size = clip_->detections.detections2d;
  other_size.width = 640;
  WriteDetections(inputs.detections2d, other_size);
  EXPECT_MPC_ERROR(Capture(inputs, out_ / "take", QuickOptions()), kMismatch, "640x160");

  other_size.width = other_size.height = 0;
  for (Detections2d::Frame& frame : other_size.frames) frame.pixels *= 8;
  WriteDetections(inputs.detections2d, other_size);
  EXPECT_MPC_ERROR(Capture(inputs, out_ / "take", QuickOptions()), kMismatch, "another size");

  Detections2d nobody = clip_->detections.detections2d;
  for (Detections2d::Frame& frame : nobody.frames) frame.confidence.setZero();
  WriteDetections(inputs.detections2d, nobody);
  EXPECT_MPC_ERROR(Capture(inputs, out_ / "take", QuickOptions()), kMismatch, "no person");
}

TEST_F(CaptureTest, InputsAreNeverOverwritten) {
  CaptureInputs inputs = clip_->inputs;
  inputs.actor = out_ / "performance.glb";
  fs::copy_file(clip_->inputs.actor, inputs.actor);
  EXPECT_MPC_ERROR(Capture(inputs, out_.path(), QuickOptions()), kInvalidArgument, "overwritten");
}

TEST_F(CaptureTest, TheOutputFolderIsCheckedFirst) {
  out_.Write("file", "content");
  EXPECT_MPC_ERROR(Capture(clip_->inputs, out_ / "file"), kWriteFailed, "not a folder");
  EXPECT_MPC_ERROR(Capture(clip_->inputs, out_ / "file" / "take"), kWriteFailed, "not a folder");
}

}  // namespace
}  // namespace mpc
