// The command as a user meets it: exit codes, one sentence per error, no half-written files.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "mpc/core/units.h"
#include "mpc/eval/motions.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/bvh.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/gltf.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/pc2.h"
#include "mpc/io/world_file.h"
#include "mpc/render/lit_scene.h"
#include "mpc/render/raster.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_map.h"
#include "run_command.h"
#include "small_clip.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;
using testing::ExpectOneSentence;
using testing::FilesIn;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::Not;
using testing::Outcome;
using testing::Process;
using testing::RunCommand;
using testing::SmallClip;
using ::testing::StartsWith;
using testing::TempDir;

std::vector<std::string> CaptureArguments(const CaptureInputs& inputs, const fs::path& output) {
  return {"capture",        inputs.video.string(),
          "--actor",        inputs.actor.string(),
          "--camera",       inputs.camera,
          "--detections2d", inputs.detections2d.string(),
          "--detections3d", inputs.detections3d.string(),
          "--quiet",        "-o",
          output.string()};
}

class CommandTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { clip_ = new SmallClip(); }
  static void TearDownTestSuite() { delete clip_; }

  fs::path output() const { return folder_ / "take"; }

  // The capture with these inputs fails with a sentence that holds `part`, and writes nothing.
  void ExpectRefused(const CaptureInputs& inputs, const std::string& part) const {
    const Outcome outcome = RunCommand(CaptureArguments(inputs, output()));
    ExpectOneSentence(outcome, part);
    EXPECT_THAT(FilesIn(output()), IsEmpty());
  }

  static const SmallClip* clip_;
  TempDir folder_;
};
const SmallClip* CommandTest::clip_ = nullptr;

TEST_F(CommandTest, CapturesAndEvaluates) {
  const Outcome capture = RunCommand(CaptureArguments(clip_->inputs, output()));
  EXPECT_EQ(capture.exit_code, 0) << capture.err;
  EXPECT_THAT(FilesIn(output()),
              IsSupersetOf({"performance.glb", "motion.bvh", "joints.trc", "poses.json",
                            "masks.mp4", "overlay.mp4", "report.json"}));
  EXPECT_THAT(capture.out, HasSubstr("24 frames"));

  const std::string joints = (output() / "joints.trc").string();
  const Outcome same = RunCommand({"eval", joints, "--truth", joints, "--json"});
  EXPECT_EQ(same.exit_code, 0) << same.err;
  const nlohmann::json errors = nlohmann::json::parse(same.out);
  EXPECT_EQ(errors["pa_mpjpe"]["frames"], 24);
  EXPECT_NEAR(errors["pa_mpjpe"]["mean_mm"], 0, 1e-6);
  EXPECT_EQ(errors["absolute"]["mean_mm"], 0);
  EXPECT_THAT(errors["joints"].get<std::string>(), HasSubstr("left_toe"));

  const Outcome text = RunCommand({"eval", joints, "--truth", joints, "--joints", "all"});
  EXPECT_THAT(text.out, HasSubstr("PA-MPJPE"));
  EXPECT_THAT(text.out, HasSubstr("24 of 24 frames"));
  EXPECT_THAT(text.out, HasSubstr("head_top"));
}

TEST_F(CommandTest, SynthesizesAClipThatItCanCapture) {
  const Outcome synth = RunCommand({"synth", "-o", folder_.path().string(), "--seconds", "0.5",
                                    "--width", "160", "--height", "120", "--noise", "exact"});
  ASSERT_EQ(synth.exit_code, 0) << synth.err;
  const auto file = [&](const char* name) { return (folder_ / name).string(); };
  const Outcome capture = RunCommand(
      {"capture", file("clip.mp4"), "--actor", file("actor.glb"), "--camera", file("camera.json"),
       "--detections2d", file("detections2d.json"), "--detections3d", file("detections3d.json"),
       "-o", output().string(), "--fit-proportions", "off", "--no-overlay"});
  ASSERT_EQ(capture.exit_code, 0) << capture.err;
  const Outcome eval = RunCommand(
      {"eval", (output() / "joints.trc").string(), "--truth", file("truth.trc"), "--json"});
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  EXPECT_LT(nlohmann::json::parse(eval.out)["mpjpe"]["mean_mm"], 40);
}

// All files below a folder and their contents.
std::map<std::string, std::string> Contents(const fs::path& folder) {
  std::map<std::string, std::string> contents;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    contents[fs::relative(entry.path(), folder).string()] = ReadFile(entry.path());
  }
  return contents;
}

std::vector<std::string> SynthArguments(const fs::path& folder,
                                        const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments = {"synth",   "-o", folder.string(), "--seconds", "0.2",
                                        "--width", "64", "--height",      "80",        "--quiet"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST_F(CommandTest, SynthWritesTheWholeTruth) {
  const fs::path clip = folder_ / "clip";
  ASSERT_EQ(RunCommand(SynthArguments(clip, {"--camera", "handheld"})).exit_code, 0);
  EXPECT_THAT(FilesIn(clip),
              ::testing::UnorderedElementsAre("actor.glb", "camera.json", "clip.mp4",
                                              "detections2d.json", "detections3d.json", "masks",
                                              "truth.json", "truth.trc", "vertices.pc2"));
  const nlohmann::json truth = nlohmann::json::parse(ReadFile(clip / "truth.json"));
  EXPECT_EQ(truth["format"], "mpc-truth");
  EXPECT_EQ(truth["frames"], 6);
  EXPECT_EQ(truth["camera_motion"], "handheld");
  EXPECT_EQ(truth["noise"], "measured");
  for (const char* file : {"video", "actor", "camera", "joints", "vertices", "masks",
                           "detections2d", "detections3d"}) {
    EXPECT_TRUE(fs::exists(clip / truth[file].get<std::string>())) << file;
  }
  // The files alone, read again, give the masks.
  const RigAsset rig = ReadRigGltf(clip / "actor.glb");
  const Character character = BuildCharacter(rig, MapRigByNames(rig));
  Camera camera = ReadCamera((clip / "camera.json").string());
  const std::vector<CameraFromWorld> motion = ReadCameraMotion((clip / "camera.json").string());
  ASSERT_EQ(motion.size(), 6u);
  Pc2Reader vertices(clip / "vertices.pc2");
  MaskReader masks(clip / "masks", camera.width, camera.height);
  for (int f = 0; f < 6; ++f) {
    Eigen::Matrix3Xf x;
    vertices.Read(f, &x);
    cv::Mat mask;
    ASSERT_TRUE(masks.Read(&mask));
    const cv::Mat drawn = MeshMask(camera, ToCamera(motion[f], x), character.mesh.triangles);
    EXPECT_GT(cv::countNonZero(drawn), 100);
    EXPECT_EQ(cv::countNonZero(drawn != mask), 0) << f;
  }
}

// A camera of which only the lens is known: it pans, or it rests before a background that moves.
TEST_F(CommandTest, CaptureFollowsACameraThatNobodyPlaced) {
  for (const std::string camera : {"pan", "static"}) {
    const fs::path clip = folder_ / camera;
    ASSERT_EQ(RunCommand({"synth", "-o", clip.string(), "--seconds", "1.5", "--width", "320",
                          "--height", "240", "--samples", "1", "--camera", camera, "--quiet"})
                  .exit_code,
              0);
    const std::string places = (clip / "camera.json").string();
    const std::vector<CameraFromWorld> truth = ReadCameraMotion(places);
    Camera lens = ReadCamera(places);
    lens.has_extrinsics = false;
    WriteCameras(clip / "lens.json", {lens});
    CaptureInputs inputs = {.video = clip / "clip.mp4",
                            .actor = clip / "actor.glb",
                            .camera = (clip / "lens.json").string(),
                            .detections2d = clip / "detections2d.json",
                            .detections3d = clip / "detections3d.json"};
    std::vector<std::string> arguments = CaptureArguments(inputs, clip / "take");
    arguments.insert(arguments.end(), {"--no-masks", "--no-overlay"});
    const Outcome outcome = RunCommand(arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const WorldPlacement world = ReadWorld(clip / "take" / "report.json");
    if (camera == "static") {
      EXPECT_TRUE(world.moving_world_from_camera.empty());
      EXPECT_THAT(outcome.err, Not(HasSubstr("camera moves")));
      continue;
    }
    EXPECT_THAT(outcome.err, HasSubstr("its turns"));
    ASSERT_EQ(world.moving_world_from_camera.size(), truth.size());
    const auto turn_between = [](const auto& first, const auto& last) {
      return Eigen::Matrix3d(last.rotation * first.rotation.transpose());
    };
    const Eigen::Matrix3d turned = turn_between(truth.front(), truth.back());
    EXPECT_GT(LogSO3(turned).norm(), 5 * kDegree);
    const Eigen::Matrix3d found = turn_between(world.moving_world_from_camera.front().Inverse(),
                                               world.moving_world_from_camera.back().Inverse());
    EXPECT_LT(LogSO3(found * turned.transpose()).norm(), 1 * kDegree);  // 5 px here

    arguments.push_back("--still-camera");
    ASSERT_EQ(RunCommand(arguments).exit_code, 0);
    EXPECT_TRUE(ReadWorld(clip / "take" / "report.json").moving_world_from_camera.empty());
  }
}

TEST_F(CommandTest, SynthGivesTheSameBytesAgain) {
  const std::vector<std::string> options = {"--camera", "handheld", "--seed", "5"};
  ASSERT_EQ(RunCommand(SynthArguments(folder_ / "a", options)).exit_code, 0);
  std::vector<std::string> one = options;
  one.insert(one.end(), {"--threads", "1"});
  ASSERT_EQ(RunCommand(SynthArguments(folder_ / "b", one)).exit_code, 0);
  const std::map<std::string, std::string> a = Contents(folder_ / "a");
  const std::map<std::string, std::string> b = Contents(folder_ / "b");
  EXPECT_EQ(a.size(), 14u);  // 8 files and 6 masks
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [name, bytes] : a) EXPECT_TRUE(bytes == b.at(name)) << name;
}

TEST_F(CommandTest, SynthWithoutDetectionsWritesNone) {
  const fs::path clip = folder_ / "clip";
  ASSERT_EQ(RunCommand(SynthArguments(clip)).exit_code, 0);
  ASSERT_EQ(RunCommand(SynthArguments(clip, {"--noise", "off", "--occluders"})).exit_code, 0);
  EXPECT_THAT(FilesIn(clip), Not(::testing::Contains(HasSubstr("detections"))));
  EXPECT_FALSE(nlohmann::json::parse(ReadFile(clip / "truth.json")).contains("detections2d"));
}

TEST_F(CommandTest, SynthPerformsABvhWithAUsersActor) {
  const Skeleton skeleton = DefaultSkeleton();
  const fs::path bvh = folder_ / "squat.bvh";
  WriteBvh(bvh, BvhFromPoses(skeleton, MakeMotion(skeleton, MotionKind::kSquat, 1, 60), 60));
  const fs::path clip = folder_ / "clip";
  const Outcome outcome = RunCommand(
      SynthArguments(clip, {"--motion", bvh.string(), "--start", "0.5", "--fps", "25", "--actor",
                            clip_->inputs.actor.string(), "--place", "park"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(FilesIn(clip / "masks").size(), 5u);  // 0.2 s
  EXPECT_EQ(ReadFile(clip / "actor.glb"), ReadFile(clip_->inputs.actor));
  EXPECT_EQ(nlohmann::json::parse(ReadFile(clip / "truth.json"))["motion"], "squat");
}

TEST_F(CommandTest, SynthRefusesBadInputsInOneSentence) {
  const fs::path clip = folder_ / "clip";
  const auto refused = [&](const std::vector<std::string>& more, const std::string& part) {
    ExpectOneSentence(RunCommand(SynthArguments(clip, more)), part);
    EXPECT_THAT(FilesIn(clip), Not(::testing::Contains("truth.json")));
    EXPECT_THAT(FilesIn(clip), Not(::testing::Contains("clip.mp4")));
  };
  refused({"--motion", (folder_ / "none.bvh").string()}, "none.bvh");
  const std::string broken = folder_.Write("broken.bvh", "HIERARCHY\nROOT Hips\n{").string();
  refused({"--motion", broken}, "broken.bvh");
  const fs::path bvh = folder_ / "walk.bvh";
  const Skeleton skeleton = DefaultSkeleton();
  WriteBvh(bvh, BvhFromPoses(skeleton, MakeMotion(skeleton, MotionKind::kWalk, 0.5, 30), 30));
  refused({"--motion", bvh.string(), "--start", "7"}, "behind its end");
  refused({"--start", "7"}, "--start");
  refused({"--fov", "nan"}, "fov");
  refused({"--start", "nan"}, "nan s");
  refused({"--actor", (folder_ / "none.glb").string()}, "none.glb");
  refused({"--actor", folder_.Write("garbage.glb", "no mesh").string()}, "garbage.glb");
  ExpectOneSentence(RunCommand(SynthArguments("/proc/clip")), "/proc/clip");
  for (const std::vector<std::string>& usage :
       std::vector<std::vector<std::string>>{{"--motion", "fly"},
                                             {"--camera", "crane"},
                                             {"--noise", "none"},
                                             {"--shutter", "2"},
                                             {"--samples", "0"},
                                             {"--outfit", "kilt"},
                                             {"--place", "moon"},
                                             {"--seconds", "-1"}}) {
    EXPECT_EQ(RunCommand(SynthArguments(clip, usage)).exit_code, 2) << usage[0] << usage[1];
  }
  EXPECT_EQ(RunCommand({"synth"}).exit_code, 2);
}

TEST_F(CommandTest, CtrlCLeavesNoHalfSynthesizedClip) {
  const fs::path clip = folder_ / "clip";
  ASSERT_EQ(RunCommand(SynthArguments(clip)).exit_code, 0);  // of an earlier run
  const Process process({MPC_COMMAND, "synth", "-o", clip.string(), "--outfit", "tight",
                         "--seconds", "20", "--width", "320", "--height", "240"});
  process.WaitFor("clip ");
  process.Signal(SIGINT);
  const Outcome outcome = process.Wait();
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_THAT(FilesIn(clip),
              ::testing::UnorderedElementsAre("actor.glb", "camera.json", "detections2d.json",
                                              "detections3d.json", "truth.trc", "vertices.pc2"));
}

TEST_F(CommandTest, SegmentsWhatWasCaptured) {
  std::vector<std::string> unrefined = CaptureArguments(clip_->inputs, output());
  unrefined.insert(unrefined.end(), {"--refine", "none"});  // masks of the poses in the folder
  ASSERT_EQ(RunCommand(unrefined).exit_code, 0);
  const std::string again = (folder_ / "again").string();
  const std::string masks = (output() / "masks.mp4").string();
  const Outcome segment = RunCommand(
      {"segment", output().string(), "-o", again, "--png", "--quiet", "--true-masks", masks});
  EXPECT_EQ(segment.exit_code, 0) << segment.err;
  EXPECT_THAT(segment.out, HasSubstr("masks.mp4 masks overlay.mp4 silhouettes.json"));
  EXPECT_THAT(segment.out, HasSubstr("over 24 frames, mean and worst tenth: silhouettes 1.0000"));
  EXPECT_EQ(FilesIn(folder_ / "again" / "masks").size(), 24u);

  // Its masks in place of the stage: the same video comes out.
  std::vector<std::string> arguments = CaptureArguments(clip_->inputs, folder_ / "given");
  arguments.insert(arguments.end(), {"--masks", again + "/masks", "--no-overlay"});
  const Outcome given = RunCommand(arguments);
  EXPECT_EQ(given.exit_code, 0) << given.err;
  EXPECT_EQ(ReadFile(folder_ / "given" / "masks.mp4"), ReadFile(masks));

  EXPECT_EQ(RunCommand({"segment", output().string()}).exit_code, 2);
  arguments.push_back("--no-masks");
  EXPECT_EQ(RunCommand(arguments).exit_code, 2);
  ExpectOneSentence(RunCommand({"segment", again, "-o", again}), "poses.json");
  ExpectOneSentence(RunCommand({"segment", output().string(), "-o", output().string()}),
                    "is a capture folder");
  ExpectOneSentence(RunCommand({"segment", output().string(), "-o", "/proc/x"}), "/proc/x");
}

TEST_F(CommandTest, MasksOfAnotherClipAreRefused) {
  CaptureInputs inputs = clip_->inputs;
  std::vector<std::string> arguments = CaptureArguments(inputs, output());
  arguments.push_back("--masks");
  const auto refused = [&](const fs::path& masks, const std::string& part) {
    arguments.push_back(masks.string());
    ExpectOneSentence(RunCommand(arguments), part);
    EXPECT_THAT(FilesIn(output()), IsEmpty());
    arguments.pop_back();
  };
  refused(folder_ / "none", "none");
  refused(folder_.Write("garbage.mp4", "no video"), "garbage.mp4");
  fs::create_directory(folder_ / "empty");
  refused(folder_ / "empty", "no pictures");
  testing::WriteNoiseVideo(folder_ / "short.mp4", SmallClip::kWidth, SmallClip::kHeight, 25, 20);
  refused(folder_ / "short.mp4", "short.mp4 has 20 frames");
  testing::WriteNoiseVideo(folder_ / "small.mp4", 64, 80, 25, 24);
  refused(folder_ / "small.mp4", "64 x 80");
}

TEST_F(CommandTest, ShowsHowARigIsMapped) {
  const Outcome info = RunCommand({"actor", "info", clip_->inputs.actor.string()});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  EXPECT_THAT(info.out, HasSubstr("left_upper_arm   leftUpperArm"));
  EXPECT_THAT(info.out, HasSubstr("33 degrees of freedom"));
  EXPECT_THAT(info.err, IsEmpty());
}

TEST_F(CommandTest, UsageErrorsExitWith2) {
  EXPECT_EQ(RunCommand({}).exit_code, 2);
  EXPECT_EQ(RunCommand({"dance"}).exit_code, 2);
  EXPECT_EQ(RunCommand({"capture"}).exit_code, 2);
  std::vector<std::string> both = CaptureArguments(clip_->inputs, output());
  both.insert(both.end(), {"--fov", "60"});
  EXPECT_EQ(RunCommand(both).exit_code, 2);
  std::vector<std::string> preset = CaptureArguments(clip_->inputs, output());
  preset.insert(preset.end(), {"--preset", "magic"});
  EXPECT_EQ(RunCommand(preset).exit_code, 2);
  EXPECT_EQ(RunCommand({"--help"}).exit_code, 0);
  EXPECT_THAT(FilesIn(output()), IsEmpty());
}

TEST_F(CommandTest, RendersWhatWasCaptured) {
  std::vector<std::string> arguments = CaptureArguments(clip_->inputs, output());
  arguments.insert(arguments.end(), {"--surface", "full", "--no-overlay"});
  const Outcome capture = RunCommand(arguments);
  ASSERT_EQ(capture.exit_code, 0) << capture.err;
  EXPECT_THAT(FilesIn(output()), IsSupersetOf({"surface.pc2", "performance.glb"}));
  EXPECT_THAT(capture.out, HasSubstr("24 morph targets"));
  const nlohmann::json report = nlohmann::json::parse(ReadFile(output() / "report.json"));
  EXPECT_EQ(report["surface"]["morph_targets"], 24);
  EXPECT_LT(report["surface"]["max_error_mm"], 0.02);

  const std::string take = output().string();
  const std::string view = (folder_ / "view.mp4").string();
  const Outcome render = RunCommand({"render", take, "-o", view, "--orbit", "360"});
  EXPECT_EQ(render.exit_code, 0) << render.err;
  EXPECT_THAT(render.out, HasSubstr("24 frames of 128 x 160"));
  EXPECT_THAT(render.err, HasSubstr("render 24/24"));
  EXPECT_EQ(VideoReader(view).num_frames(), 24);

  // The mask from the capture's camera, and from the same camera by its file.
  const std::string own = (folder_ / "own").string(), given = (folder_ / "given").string();
  EXPECT_EQ(RunCommand({"render", take, "-o", own, "--mask", "--quiet"}).exit_code, 0);
  EXPECT_EQ(RunCommand({"render", take, "-o", given, "--mask", "--quiet", "--camera",
                        clip_->inputs.camera})
                .exit_code,
            0);
  EXPECT_EQ(FilesIn(own).size(), 24u);
  EXPECT_EQ(ReadFile(folder_ / "own/000007.png"), ReadFile(folder_ / "given/000007.png"));

  // A point cache alone, in the world of a camera.
  const std::string cache = (output() / "surface.pc2").string();
  const std::string glb = (output() / "performance.glb").string();
  const std::string& camera = clip_->inputs.camera;
  const std::string cached = (folder_ / "cached").string();
  const Outcome of_cache = RunCommand({"render", cache, "--actor", glb, "--camera", camera, "-o",
                                       cached, "--quiet", "--background", clip_->inputs.video});
  EXPECT_EQ(of_cache.exit_code, 0) << of_cache.err;
  EXPECT_EQ(FilesIn(cached).size(), 24u);
}

TEST_F(CommandTest, RenderRefusesWhatItCannotShow) {
  std::vector<std::string> arguments = CaptureArguments(clip_->inputs, output());
  arguments.insert(arguments.end(), {"--no-overlay", "--surface", "key"});
  ASSERT_EQ(RunCommand(arguments).exit_code, 0);
  const std::string take = output().string(), to = (folder_ / "to").string();
  const std::string cache = (output() / "surface.pc2").string();
  const auto render = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"render", "--quiet", "-o", to});
    return RunCommand(more);
  };
  EXPECT_EQ(RunCommand({"render", take}).exit_code, 2);
  EXPECT_EQ(render({take, "--mask", "--background", "x.png"}).exit_code, 2);
  EXPECT_EQ(render({take, "--orbit", "9", "--background", "x.png"}).exit_code, 2);
  ExpectOneSentence(render({folder_.path().string()}), "poses.json");
  ExpectOneSentence(render({take, "--camera", "none.json"}), "none.json");
  ExpectOneSentence(render({take, "--background", "none.mp4"}), "none.mp4");
  ExpectOneSentence(render({take, "--actor", "none.glb"}), "none.glb");
  ExpectOneSentence(RunCommand({"render", take, "-o", clip_->inputs.video.string()}),
                    "overwritten");
  ExpectOneSentence(RunCommand({"render", take, "-o", "/proc/x/a.mp4"}), "/proc/x");
  ExpectOneSentence(render({cache}), "--actor and --camera");
  const std::string actor = clip_->inputs.actor.string();
  ExpectOneSentence(render({"none.pc2", "--actor", actor, "--camera", clip_->inputs.camera}),
                    "none.pc2");
  const std::string cut = folder_.Write("cut.pc2", ReadFile(cache).substr(0, 1000)).string();
  ExpectOneSentence(render({cut, "--actor", actor, "--camera", clip_->inputs.camera}), "cut.pc2");
  fs::remove(output() / "report.json");
  ExpectOneSentence(render({take}), "report.json");
  EXPECT_THAT(FilesIn(to), IsEmpty());
}

// Every input: missing, a folder, empty, garbage, cut in half.
TEST_F(CommandTest, BrokenInputsAreRefused) {
  struct Input {
    const char* name;
    fs::path good;
    std::function<void(CaptureInputs*, const fs::path&)> set;
  };
  const std::vector<Input> all = {
      {"clip.mp4", clip_->inputs.video, [](auto* inputs, const auto& p) { inputs->video = p; }},
      {"actor.glb", clip_->inputs.actor, [](auto* inputs, const auto& p) { inputs->actor = p; }},
      {"camera.json", clip_->inputs.camera,
       [](auto* inputs, const auto& p) { inputs->camera = p.string(); }},
      {"detections2d.json", clip_->inputs.detections2d,
       [](auto* inputs, const auto& p) { inputs->detections2d = p; }},
      {"detections3d.json", clip_->inputs.detections3d,
       [](auto* inputs, const auto& p) { inputs->detections3d = p; }}};
  for (const Input& input : all) {
    SCOPED_TRACE(input.name);
    CaptureInputs inputs = clip_->inputs;
    const fs::path path = folder_ / input.name;
    input.set(&inputs, path);
    ExpectRefused(inputs, path.string());  // missing
    const std::string good = ReadFile(input.good);
    for (const std::string& bad : {std::string(), std::string(1000, '\xA5'),
                                   std::string("{\"a\": ["), good.substr(0, good.size() / 2)}) {
      folder_.Write(input.name, bad);
      ExpectRefused(inputs, path.string());
    }
    fs::remove(path);
    fs::create_directory(path);
    ExpectRefused(inputs, path.string());
    fs::remove(path);
  }
}

TEST_F(CommandTest, NotANumberIsRefused) {
  CaptureInputs inputs = clip_->inputs;
  const std::string detections = ReadFile(inputs.detections2d);
  const size_t digit = detections.find_first_of("123456789", detections.find("frames"));
  inputs.detections2d =
      folder_.Write("nan.json", detections.substr(0, digit) + "NaN" +
                                    detections.substr(detections.find_first_of(",]", digit)));
  ExpectRefused(inputs, "nan.json");

  inputs = clip_->inputs;
  std::string glb = ReadFile(inputs.actor);
  const size_t binary = glb.find(std::string("BIN\0", 4)) + 4;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(glb.data() + binary, &nan, sizeof(nan));
  inputs.actor = folder_.Write("nan.glb", glb);
  ExpectRefused(inputs, "nan.glb");
}

TEST_F(CommandTest, RigsThatAreNoHumanoidAreRefused) {
  CaptureInputs inputs = clip_->inputs;
  inputs.actor = folder_.Write(
      "cube.gltf",
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"name":"n"}]})");
  ExpectRefused(inputs, "cube.gltf");  // no skin

  RigAsset nameless = clip_->rig;
  for (size_t b = 0; b < nameless.bones.size(); ++b) {
    nameless.bones[b].name = "thing" + std::to_string(b);
  }
  inputs.actor = folder_ / "things.glb";
  WriteRigGltf(inputs.actor, nameless);
  ExpectRefused(inputs, "things.glb");
}

TEST_F(CommandTest, BadWeightsAreReportedAndRepaired) {
  RigAsset rig = clip_->rig;
  for (RigMesh& mesh : rig.meshes) mesh.weights *= 0.5F;
  CaptureInputs inputs = clip_->inputs;
  inputs.actor = folder_ / "half.glb";
  WriteRigGltf(inputs.actor, rig);
  const Outcome info = RunCommand({"actor", "info", inputs.actor.string()});
  EXPECT_EQ(info.exit_code, 0);
  EXPECT_THAT(info.err, HasSubstr("monoperfcap: warning: "));
  const Outcome capture = RunCommand(CaptureArguments(inputs, output()));
  EXPECT_EQ(capture.exit_code, 0) << capture.err;
  EXPECT_THAT(capture.err, HasSubstr("monoperfcap: warning: "));
}

TEST_F(CommandTest, FrameCountsAreComparedWithTheVideo) {
  CaptureInputs inputs = clip_->inputs;
  inputs.video = folder_ / "short.mp4";
  testing::WriteNoiseVideo(inputs.video, SmallClip::kWidth, SmallClip::kHeight, SmallClip::kFps,
                           clip_->num_frames - 5);
  ExpectRefused(inputs, "24 frames");
  ExpectRefused(inputs, "19");
}

TEST_F(CommandTest, TheOutputFolderMustBeWritable) {
  folder_.Write("take", "a file");
  ExpectOneSentence(RunCommand(CaptureArguments(clip_->inputs, output())), "take");
  ExpectOneSentence(RunCommand(CaptureArguments(clip_->inputs, "/proc/take")), "/proc/take");
}

// The shell's limit is in blocks of 1024 bytes.
Outcome RunWithFileLimit(int blocks, const std::vector<std::string>& arguments) {
  std::string line = "ulimit -f " + std::to_string(blocks) + "; exec '" MPC_COMMAND "'";
  for (const std::string& argument : arguments) line += " '" + argument + "'";
  return Process({"bash", "-c", line}).Wait();
}

TEST_F(CommandTest, AFullDiskLeavesNoHalfWrittenFile) {
  // Nothing large fits.
  ExpectOneSentence(RunWithFileLimit(8, CaptureArguments(clip_->inputs, output())), "take");
  EXPECT_THAT(FilesIn(output()), IsEmpty());
  // All but the overlay fit: what is there is whole, and no report vouches for the take.
  const auto arguments = [&](const fs::path& folder) {
    std::vector<std::string> list = CaptureArguments(clip_->inputs, folder);
    list.insert(list.end(), {"--refine", "pose"});  // surface.pc2 would be as large
    return list;
  };
  ASSERT_EQ(RunCommand(arguments(folder_ / "whole")).exit_code, 0);
  const auto size = [&](const char* name) { return fs::file_size(folder_ / "whole" / name); };
  ASSERT_GT(size("overlay.mp4"), size("performance.glb") + 4096);
  const auto blocks = static_cast<int>(size("performance.glb") / 1024 + 2);
  ExpectOneSentence(RunWithFileLimit(blocks, arguments(output())), "overlay.mp4");
  EXPECT_THAT(FilesIn(output()),
              ::testing::UnorderedElementsAre("performance.glb", "motion.bvh", "joints.trc",
                                              "poses.json", "masks.mp4"));
  EXPECT_EQ(ReadFile(output() / "performance.glb"),
            ReadFile(folder_ / "whole" / "performance.glb"));
}

TEST_F(CommandTest, AFullDeviceIsAnError) {
  fs::create_directory(output());
  fs::create_symlink("/dev/full", output() / "motion.bvh");
  folder_.Write("take/report.json", "of an earlier run");
  const Outcome outcome = RunCommand(CaptureArguments(clip_->inputs, output()));
  ExpectOneSentence(outcome, "motion.bvh");
  EXPECT_THAT(FilesIn(output()), Not(::testing::Contains("report.json")));

  const std::string info = "'" MPC_COMMAND "' actor info '" + clip_->inputs.actor.string() + "'";
  ExpectOneSentence(Process({"bash", "-c", info + " > /dev/full"}).Wait(), "standard output");
}

TEST_F(CommandTest, CtrlCKeepsWhatIsFinishedAndExitsWith130) {
  // Long enough that frames are still being refined when the signal comes.
  const SmallClip longer(240);
  std::vector<std::string> arguments = CaptureArguments(longer.inputs, output());
  std::erase(arguments, "--quiet");
  arguments.insert(arguments.begin(), MPC_COMMAND);
  const Process process(arguments);
  process.WaitFor("refinement");
  process.Signal(SIGINT);
  const Outcome outcome = process.Wait();
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("interrupted"));
  EXPECT_THAT(FilesIn(output()),
              ::testing::UnorderedElementsAre("performance.glb", "motion.bvh", "joints.trc",
                                              "poses.json", "report.json"));
  EXPECT_EQ(nlohmann::json::parse(ReadFile(output() / "report.json"))["complete"], false);
}

TEST_F(CommandTest, ProgressIsALineNowAndThen) {
  std::vector<std::string> arguments = CaptureArguments(clip_->inputs, output());
  std::erase(arguments, "--quiet");
  const Outcome outcome = RunCommand(arguments);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, StartsWith("video 1/24"));
  EXPECT_THAT(outcome.err, HasSubstr("\npose "));
  EXPECT_THAT(outcome.err, HasSubstr("refinement 24/24 (100 %)\n"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("\r")));
}

TEST_F(CommandTest, EvalRefusesTruthOfAnotherClip) {
  const fs::path a = folder_.Write("a.json", R"({"fps":30,"names":["LHip"],"joints":[[[0,0,0]]]})");
  const fs::path b = folder_.Write("b.json", R"({"fps":30,"names":["LHip"],"joints":[]})");
  const fs::path c = folder_.Write("c.json", R"({"fps":30,"names":["RHip"],"joints":[[[0,0,0]]]})");
  ExpectOneSentence(RunCommand({"eval", a.string(), "--truth", b.string()}), "frames");
  ExpectOneSentence(RunCommand({"eval", a.string(), "--truth", c.string()}), "in common");
  ExpectOneSentence(RunCommand({"eval", a.string(), "--truth", (folder_ / "d").string()}),
                    "/d: No such file");
}

}  // namespace
}  // namespace mpc
