// `monoperfcap eval` on a folder: truth against itself, known perturbations, broken inputs.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/run_program.h"
#include "mpc/eval/motions.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/pc2.h"
#include "mpc/io/poses_file.h"
#include "mpc/io/trc.h"
#include "mpc/io/truth_file.h"
#include "mpc/render/model_mask.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"
#include "small_clip.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ProgramResult;
using testing::SmallClip;
using ::testing::StartsWith;
using testing::TempDir;
using Json = nlohmann::json;

constexpr int kNumFrames = 10;

// A clip with all of its truth, and a capture that found it exactly.
class EvalCommandTest : public ::testing::Test {
 protected:
  EvalCommandTest() {
    const Camera& camera = clip_.camera;
    poses_ = MakeMotion(clip_.character.skeleton, MotionKind::kReach, kNumFrames / SmallClip::kFps,
                        SmallClip::kFps);
    in_camera_ = TransformPoses(camera.camera_from_world.rotation,
                                camera.camera_from_world.translation, poses_);
    truth_.fps = SmallClip::kFps;
    truth_.num_frames = kNumFrames;
    truth_.width = camera.width;
    truth_.height = camera.height;
    truth_.video = clip_.inputs.video;
    truth_.actor = clip_.inputs.actor;
    truth_.camera = clip_.inputs.camera;
    WriteJoints();
    WriteVerticesAndMasks(in_camera_);
    WriteTruth();
    fs::create_directory(take());
    WriteTake(in_camera_);
  }

  fs::path take() const { return clip_.folder / "take"; }
  std::string file(const std::string& name) const { return (clip_.folder / name).string(); }
  void WriteTruth() const { WriteTruthClip(clip_.folder.path(), truth_); }

  void WriteJoints() {
    MarkerTrajectories markers;
    markers.fps = SmallClip::kFps;
    for (const SkeletonJoint& joint : clip_.character.skeleton.joints) {
      markers.names.emplace_back(JointName(joint.id));
    }
    markers.positions = JointTrajectories(clip_.character.skeleton, poses_);
    truth_.joints = clip_.folder / "truth.trc";
    WriteTrc(truth_.joints, markers);
  }

  void WriteVerticesAndMasks(const Eigen::MatrixXd& poses_in_camera) {
    const Character& character = clip_.character;
    const SurfaceTopology topology = SurfaceTopology::FromMesh(character.mesh);
    truth_.vertices = clip_.folder / "vertices.pc2";
    truth_.masks = clip_.folder / "masks";
    Pc2Writer vertices(truth_.vertices, static_cast<int>(character.mesh.positions.cols()));
    MaskFolderWriter masks(truth_.masks);
    KinematicState state;
    Eigen::Matrix3Xf posed;
    for (int f = 0; f < kNumFrames; ++f) {
      ForwardKinematics(character.skeleton, poses_.col(f), &state);
      SkinCharacter(character, state, &posed);
      vertices.Write(posed);
      ForwardKinematics(character.skeleton, poses_in_camera.col(f), &state);
      SkinCharacter(character, state, &posed);
      cv::Mat mask;
      ModelMask(clip_.camera, posed, topology, &mask);
      masks.Write(mask);
    }
    vertices.Close();
    masks.Close();
  }

  void WriteTake(const Eigen::MatrixXd& poses) const {
    CapturedPoses captured;
    captured.video = clip_.inputs.video;
    captured.actor = clip_.inputs.actor;
    captured.fps = SmallClip::kFps;
    captured.camera = clip_.camera;
    captured.dofs = {"root_tx", "root_ty", "root_tz", "root_rx", "root_ry", "root_rz"};
    for (const Hinge& hinge : clip_.character.skeleton.hinges) captured.dofs.push_back(hinge.name);
    captured.poses = poses;
    WritePoses(take() / "poses.json", captured);
  }

  ProgramResult Eval(const std::string& truth, const std::string& more = "") const {
    return testing::RunProgram(MPC_COMMAND " eval --quiet '" + take().string() + "' --truth '" +
                               truth + "' " + more);
  }
  ProgramResult Eval() const { return Eval(clip_.folder.path().string()); }

  Json Scores() const {
    const ProgramResult run = Eval(file("truth.json"), "--no-html --json");
    EXPECT_EQ(run.status, 0) << run.output;
    return Json::parse(run.output, nullptr, false);
  }

  void ExpectOneSentence(const ProgramResult& run, const std::string& part) const {
    EXPECT_NE(run.status, 0);
    EXPECT_THAT(run.output, StartsWith("monoperfcap: error: "));
    EXPECT_THAT(run.output, HasSubstr(part));
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  }

  SmallClip clip_{kNumFrames};
  Eigen::MatrixXd poses_;      // world
  Eigen::MatrixXd in_camera_;  // what was captured
  TruthClip truth_;
};

// Joints come from a file of micrometres, vertices from one of floats.
constexpr double kRounding = 2e-3;

TEST_F(EvalCommandTest, TruthAgainstItselfIsZero) {
  const Json scores = Scores();
  for (const char* key : {"mpjpe", "n_mpjpe", "pa_mpjpe", "absolute", "root", "vertex_error",
                          "surface_error", "foot_skate"}) {
    EXPECT_NEAR(scores[key]["mean_mm"].get<double>(), 0, kRounding) << key;
  }
  EXPECT_NEAR(scores["reprojection"]["mean_px"].get<double>(), 0, kRounding);
  EXPECT_NEAR(scores["acceleration_error"]["mean_mm_per_frame2"].get<double>(), 0, 2 * kRounding);
  EXPECT_NEAR(scores["limb_length_deviation"]["max_mm"].get<double>(), 0, kRounding);
  for (const char* key : {"model_iou", "model_iou_worst_tenth", "model_boundary_f"}) {
    EXPECT_EQ(scores[key]["mean"], 1) << key;
  }
  EXPECT_EQ(scores["vertex_error"]["frames"], kNumFrames);
  EXPECT_THAT(scores["skipped"].dump(), HasSubstr("extracted silhouettes"));
}

TEST_F(EvalCommandTest, AMovedCaptureGivesItsDistance) {
  Eigen::MatrixXd moved = in_camera_;
  moved.row(0).array() += 0.03;
  moved.row(2).array() += 0.04;
  WriteTake(moved);
  const Json scores = Scores();
  EXPECT_NEAR(scores["absolute"]["mean_mm"].get<double>(), 50, kRounding);
  EXPECT_NEAR(scores["root"]["mean_mm"].get<double>(), 50, kRounding);
  EXPECT_NEAR(scores["mpjpe"]["mean_mm"].get<double>(), 0, kRounding);
  EXPECT_NEAR(scores["vertex_error"]["mean_mm"].get<double>(), 0, kRounding);
  EXPECT_THAT(scores["vertex_error"]["alignment"].get<std::string>(),
              HasSubstr("(-30.0 0.0 -40.0)"));
  EXPECT_LT(scores["model_iou"]["mean"], 1);
  EXPECT_GT(scores["reprojection"]["mean_px"], 0.5);
}

TEST_F(EvalCommandTest, ASlideIsSkateAndAMovingCameraIsNot) {
  // To the right by 5 mm a frame, in the world.
  Eigen::MatrixXd sliding = poses_;
  for (int f = 0; f < kNumFrames; ++f) sliding(0, f) += 0.005 * f;
  const CameraFromWorld& place = clip_.camera.camera_from_world;
  WriteTake(TransformPoses(place.rotation, place.translation, sliding));
  EXPECT_NEAR(Scores()["foot_skate"]["mean_mm"].get<double>(), 5, 0.01);

  // A camera that pans and goes along, with the right poses in front of it.
  std::vector<CameraFromWorld> motion;
  Eigen::MatrixXd in_moving(in_camera_.rows(), kNumFrames);
  for (int f = 0; f < kNumFrames; ++f) {
    const Rigid<CameraFrame, CameraFrame> step = {ExpSO3({0, 0.02 * f, 0.003 * f}),
                                                  {0.02 * f, 0, 0.01 * f}};
    motion.push_back(step * place);
    in_moving.col(f) =
        TransformPoses(motion.back().rotation, motion.back().translation, poses_.col(f));
  }
  WriteMovingCamera(clip_.folder / "camera.json", clip_.camera, motion);
  WriteTake(in_moving);
  const Json scores = Scores();
  for (const char* key : {"absolute", "vertex_error", "surface_error", "foot_skate"}) {
    EXPECT_NEAR(scores[key]["mean_mm"].get<double>(), 0, kRounding) << key;
  }
  EXPECT_NEAR(scores["acceleration_error"]["mean_mm_per_frame2"].get<double>(), 0, 2 * kRounding);
}

TEST_F(EvalCommandTest, WritesAPageThatNeedsNothingElse) {
  const ProgramResult run = Eval(clip_.folder.path().string(), "--json '" + file("out.json") + "'");
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("14 joints; aligned: root translation; 10 of 10 frames"));
  EXPECT_THAT(run.output, HasSubstr("one translation of the clip"));
  EXPECT_EQ(Json::parse(ReadFile(file("out.json")))["format"], "mpc-evaluation");
  const std::string page = ReadFile(take() / "evaluation.html");
  EXPECT_THAT(page, StartsWith("<!doctype html>"));
  EXPECT_THAT(page, HasSubstr("</html>"));
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_THAT(page, HasSubstr("src=\"data:image/jpeg;base64,"));
  EXPECT_THAT(page, Not(HasSubstr("http")));
  EXPECT_THAT(page, Not(HasSubstr("nan")));
}

TEST_F(EvalCommandTest, WhatTheTruthLacksIsSkippedAndNamed) {
  truth_.vertices.clear();
  truth_.masks.clear();
  WriteTruth();
  const ProgramResult run = Eval();
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("skipped: masks"));
  EXPECT_THAT(run.output, HasSubstr("skipped: surface error"));
  EXPECT_THAT(run.output, Not(HasSubstr("IoU")));

  // Joints and masks of another origin: no floor.
  const ProgramResult joints = Eval(file("truth.trc"), "--true-masks '" + file("masks") + "'");
  ASSERT_EQ(joints.status, 0) << joints.output;
  EXPECT_THAT(joints.output, HasSubstr("skipped: foot skate"));
  EXPECT_THAT(joints.output, HasSubstr("1.0000            mesh against true masks"));
}

TEST_F(EvalCommandTest, AnotherActorHasNoSurfaceError) {
  Pc2Writer vertices(truth_.vertices, 5);
  for (int f = 0; f < kNumFrames; ++f) vertices.Write(Eigen::Matrix3Xf::Zero(3, 5));
  vertices.Close();
  const ProgramResult run = Eval();
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("skipped: surface error: the capture's mesh has"));
}

TEST_F(EvalCommandTest, BrokenInputsAreOneSentence) {
  ExpectOneSentence(Eval(file("nothing.json")), "nothing.json");
  ExpectOneSentence(Eval(clip_.folder.Write("bad.json", "{").string()), "not valid JSON");
  ExpectOneSentence(Eval(file("take")), "truth.json");
  ExpectOneSentence(Eval(file("truth.trc"), "--true-masks '" + file("none") + "'"), "none");

  WriteTake(in_camera_.leftCols(kNumFrames - 1));
  ExpectOneSentence(Eval(), "9 frames");
  WriteTake(in_camera_);
  fs::remove(clip_.folder / "masks" / "000009.png");
  ExpectOneSentence(Eval(), "masks has 9 frames");
  fs::remove_all(clip_.folder / "masks");
  ExpectOneSentence(Eval(), "masks");
  truth_.masks.clear();
  WriteTruth();
  clip_.folder.Write("vertices.pc2", "POINTCACHE2");
  ExpectOneSentence(Eval(), "vertices.pc2");
  truth_.camera.clear();
  WriteTruth();
  ExpectOneSentence(Eval(), "names no camera");
  fs::remove(take() / "poses.json");
  ExpectOneSentence(Eval(), "poses.json");
  ExpectOneSentence(testing::RunProgram(MPC_COMMAND " eval '" + file("truth.trc") + "' --truth '" +
                                        file("truth.trc") + "' --html x.html"),
                    "file of joints");
}

TEST_F(EvalCommandTest, WithoutAVideoThereAreNoPictures) {
  fs::remove(clip_.inputs.video);
  const ProgramResult run = Eval();
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("skipped: pictures of the worst frames"));
}

}  // namespace
}  // namespace mpc
