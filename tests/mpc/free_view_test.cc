// A performance seen from any camera: masks where the capture has them, other cameras of the same
// world, orbits, textures, backgrounds.
#include "mpc/free_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/eval/metrics.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/pc2.h"
#include "mpc/render/raster.h"
#include "mpc/skeleton/skinning.h"
#include "small_clip.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;
using testing::SmallClip;
using testing::TempDir;

constexpr int kNumFrames = 6;

cv::Mat Picture(const fs::path& folder, int frame) {
  return cv::imread((folder / ("00000" + std::to_string(frame) + ".png")).string(),
                    cv::IMREAD_UNCHANGED);
}

int NumDifferent(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return -1;
  return cv::countNonZero(a.reshape(1) != b.reshape(1));
}

class FreeViewTest : public ::testing::Test {
 protected:
  FreeViewTest() {
    CaptureOptions options;
    options.overlay = options.masks = false;
    options.pose.num_threads = 1;
    report_ = Capture(clip_.inputs, out_ / "take", options).Run();
    options.surface = SurfaceTargets::kFull;
    Capture(clip_.inputs, out_ / "surface", options).Run();
  }

  // The masks of a take, seen so.
  std::vector<cv::Mat> Masks(const fs::path& folder, const TakeView& view = {},
                             RenderOptions options = {}) {
    options.mask = true;
    const Take take = ReadTake(folder);
    EXPECT_TRUE(RenderSurface(ViewOfTake(take, view), out_ / "masks", options));
    std::vector<cv::Mat> masks;
    for (int f = 0; f < kNumFrames; ++f) masks.push_back(Picture(out_ / "masks", f));
    return masks;
  }

  // What a camera sees of the captured poses: camera_from_own maps from the capture's camera.
  template <typename Transform>
  std::vector<cv::Mat> ExpectedMasks(const Camera& camera, const Transform& camera_from_own) {
    const Take take = ReadTake(out_ / "take");
    std::vector<cv::Mat> masks;
    KinematicState state;
    Eigen::Matrix3Xf vertices;
    for (int f = 0; f < kNumFrames; ++f) {
      ForwardKinematics(take.character.skeleton, take.poses.col(f), &state);
      SkinCharacter(take.character, state, &vertices);
      for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
        const Eigen::Vector3d x = vertices.col(v).cast<double>();
        vertices.col(v) = camera_from_own(f, x).template cast<float>();
      }
      masks.push_back(MeshMask(camera, vertices, take.character.mesh.triangles));
    }
    return masks;
  }

  // With surface.pc2 and without, up to the rounding of its numbers.
  void ExpectMasks(const TakeView& view, const std::vector<cv::Mat>& expected) {
    for (const char* folder : {"take", "surface"}) {
      const std::vector<cv::Mat> masks = Masks(out_ / folder, view);
      for (int f = 0; f < kNumFrames; ++f) {
        EXPECT_GT(cv::countNonZero(expected[f]), 100);
        const int different = NumDifferent(masks[f], expected[f]);
        EXPECT_GE(different, 0) << folder << " " << f;
        EXPECT_LE(different, 4) << folder << " " << f;
      }
    }
  }

  std::string SideCamera() {
    side_ = clip_.camera;
    side_.name = "side";
    side_.width = 200;
    side_.cx = 99.5;
    side_.camera_from_world = {Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()) *
                                   clip_.camera.camera_from_world.rotation *
                                   Eigen::AngleAxisd(0.9, Eigen::Vector3d::UnitY()),
                               clip_.camera.camera_from_world.translation};
    WriteCameras(out_ / "side.json", {side_});
    return (out_ / "side.json").string() + ":side";
  }

  SmallClip clip_{kNumFrames};
  TempDir out_;
  CaptureReport report_;
  Camera side_;
};

TEST_F(FreeViewTest, TheOwnCamerasMaskIsTheModelMaskOfTheCapture) {
  const Take take = ReadTake(out_ / "take");
  const std::vector<cv::Mat> masks = Masks(out_ / "take");
  ExtractSilhouettes(take.clip(), {}, [&](const SilhouetteFrame& frame) {
    EXPECT_EQ(NumDifferent(masks[static_cast<size_t>(frame.index)], frame.model), 0);
  });
  ExpectMasks({}, masks);
  ExpectMasks({.camera = clip_.inputs.camera}, masks);
}

TEST_F(FreeViewTest, AnotherCameraSeesThePersonInItsWorld) {
  const std::string side = SideCamera();
  const std::vector<cv::Mat> expected =
      ExpectedMasks(side_, [&](int, const Eigen::Vector3d& x) -> Eigen::Vector3d {
        return side_.camera_from_world * (report_.world.world_from_camera * x);
      });
  EXPECT_LT(MaskIou(expected[0](cv::Rect(0, 0, 128, 160)), Masks(out_ / "take")[0]), 0.9);
  ExpectMasks({.camera = side}, expected);

  // A path through the same world.
  std::vector<CameraFromWorld> path;
  for (int f = 0; f < kNumFrames; ++f) {
    path.push_back(side_.camera_from_world);
    path.back().translation += Eigen::Vector3d(0.1 * f, 0, 0.2);
  }
  WriteMovingCamera(out_ / "path.json", side_, path);
  ExpectMasks({.camera = (out_ / "path.json").string()},
              ExpectedMasks(side_, [&](int f, const Eigen::Vector3d& x) -> Eigen::Vector3d {
                return path[static_cast<size_t>(f)] * (report_.world.world_from_camera * x);
              }));
  path.pop_back();
  WriteMovingCamera(out_ / "path.json", side_, path);
  EXPECT_MPC_ERROR(Masks(out_ / "take", {.camera = (out_ / "path.json").string()}), kMismatch,
                   "5 frames");
}

TEST_F(FreeViewTest, AnOrbitTurnsThePersonAboutTheVertical) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  const Rigid<SceneFrame, CameraFrame> scene_from_camera = report_.world.scene_from_camera();
  for (int f = 0; f < kNumFrames; ++f) {
    middle += scene_from_camera * Eigen::Vector3d(report_.track.poses.col(f).head<3>());
  }
  middle /= kNumFrames;
  const double orbit = 1.5 * std::numbers::pi;
  ExpectMasks({.orbit_rad = orbit},
              ExpectedMasks(clip_.camera, [&](int f, const Eigen::Vector3d& x) -> Eigen::Vector3d {
                const Eigen::AngleAxisd turn(orbit * f / kNumFrames, Eigen::Vector3d::UnitY());
                return scene_from_camera.Inverse() *
                       (middle + turn * (scene_from_camera * x - middle));
              }));
}

TEST_F(FreeViewTest, PicturesAndMasksDoNotDependOnThreads) {
  const Take take = ReadTake(out_ / "take");
  for (const int threads : {1, 2, 5}) {
    const fs::path folder = out_ / ("t" + std::to_string(threads));
    ASSERT_TRUE(RenderSurface(ViewOfTake(take), folder, {.num_threads = threads}));
    for (int f = 0; f < kNumFrames; ++f) {
      EXPECT_EQ(NumDifferent(Picture(folder, f), Picture(out_ / "t1", f)), 0);
    }
  }
  ASSERT_TRUE(RenderSurface(ViewOfTake(take), out_ / "view.mp4"));
  VideoReader video(out_ / "view.mp4");
  EXPECT_EQ(video.num_frames(), kNumFrames);
  EXPECT_EQ(video.fps(), SmallClip::kFps);
  ASSERT_TRUE(RenderSurface(ViewOfTake(take), out_ / "mask.mp4", {.mask = true}));
  MaskReader masks(out_ / "mask.mp4", SmallClip::kWidth, SmallClip::kHeight);
  cv::Mat mask;
  ASSERT_TRUE(masks.Read(&mask));
  EXPECT_GT(MaskIou(mask, Masks(out_ / "take")[0]), 0.99);
}

TEST_F(FreeViewTest, TheBackgroundIsSeenWhereThePersonIsNot) {
  const Take take = ReadTake(out_ / "take");
  const std::vector<cv::Mat> masks = Masks(out_ / "take");
  cv::Mat still(SmallClip::kHeight, SmallClip::kWidth, CV_8UC3);
  cv::RNG(1).fill(still, cv::RNG::UNIFORM, 0, 256);
  cv::imwrite((out_ / "still.png").string(), still);
  fs::create_directory(out_ / "moving");
  std::vector<cv::Mat> moving;
  for (int f = 0; f < kNumFrames; ++f) {
    moving.push_back(still + cv::Scalar::all(10 * f));
    cv::imwrite((out_ / ("moving/" + std::to_string(f) + ".png")).string(), moving.back());
  }
  for (const char* background : {"still.png", "moving"}) {
    ASSERT_TRUE(RenderSurface(ViewOfTake(take), out_ / "over", {.background = out_ / background}));
    for (int f = 0; f < kNumFrames; ++f) {
      const cv::Mat picture = Picture(out_ / "over", f);
      cv::Mat outside, inside;
      picture.copyTo(outside, ~masks[f]);
      (fs::is_directory(out_ / background) ? moving[f] : still).copyTo(inside, ~masks[f]);
      EXPECT_EQ(NumDifferent(outside, inside), 0) << background << f;
      cv::Vec3b skin = picture.at<cv::Vec3b>(0, 0);
      for (int i = 0; i < masks[f].rows * masks[f].cols; ++i) {
        if (masks[f].data[i] != 0) skin = picture.ptr<cv::Vec3b>()[i];
      }
      EXPECT_EQ(skin[0], skin[2]);  // plain grey, shaded
    }
  }
  fs::remove(out_ / "moving/5.png");
  const auto render = [&](const fs::path& background) {
    RenderSurface(ViewOfTake(take), out_ / "bad", {.background = background});
  };
  EXPECT_MPC_ERROR(render(out_ / "moving"), kMismatch, "has 5 frames, the performance 6");
  EXPECT_FALSE(fs::exists(out_ / "bad"));
  cv::imwrite((out_ / "small.png").string(), cv::Mat(still.rowRange(0, 50)));
  EXPECT_MPC_ERROR(render(out_ / "small.png"), kMismatch, "128 x 50");
  EXPECT_MPC_ERROR(render(out_ / "none.png"), kFileNotFound, "none.png");
  EXPECT_MPC_ERROR(render(out_.Write("text.png", "no picture")), kBadFile, "text.png");
}

TEST_F(FreeViewTest, EveryMeshHasItsOwnTexture) {
  // Two squares side by side, the left one red, the right one plain.
  RigAsset rig;
  for (int m = 0; m < 2; ++m) {
    RigMesh& mesh = rig.meshes.emplace_back();
    mesh.mesh.positions.resize(3, 4);
    mesh.mesh.positions << 0, 1, 1, 0, 0, 0, 1, 1, 4, 4, 4, 4;
    mesh.mesh.positions.row(0).array() += static_cast<float>(m) - 1;
    mesh.mesh.triangles.resize(3, 2);
    mesh.mesh.triangles << 0, 0, 1, 2, 2, 3;
  }
  rig.meshes[0].uv = rig.meshes[0].mesh.positions.topRows<2>();
  cv::imencode(".png", cv::Mat(8, 8, CV_8UC3, cv::Scalar(0, 0, 255)), rig.meshes[0].texture);
  ViewedSurface surface = {.rig = rig, .camera = Camera::FromFov(200, 100, 1), .fps = 25};
  surface.num_frames = 1;
  surface.vertices = [&](int, Eigen::Matrix3Xf* vertices) {
    vertices->resize(3, 8);
    *vertices << rig.meshes[0].mesh.positions, rig.meshes[1].mesh.positions;
  };
  ASSERT_TRUE(RenderSurface(surface, out_ / "p"));
  const cv::Mat picture = Picture(out_ / "p", 0);
  const cv::Vec3b left = picture.at<cv::Vec3b>(60, 90), right = picture.at<cv::Vec3b>(60, 110);
  EXPECT_GT(left[2], 150);
  EXPECT_EQ(left[0], 0);
  EXPECT_EQ(right[0], right[2]);
  EXPECT_GT(right[0], 100);
  rig.meshes[0].texture.resize(20);
  EXPECT_MPC_ERROR(RenderSurface(surface, out_ / "p"), kBadFile, "texture");
}

TEST_F(FreeViewTest, StoppedWorkLeavesNothing) {
  const Take take = ReadTake(out_ / "take");
  for (const char* name : {"stopped", "stopped.mp4"}) {
    EXPECT_FALSE(RenderSurface(ViewOfTake(take), out_ / name, {.num_threads = 1},
                               [](const Progress& progress) {
                                 EXPECT_EQ(progress.stage, "render");
                                 EXPECT_EQ(progress.num_steps, kNumFrames);
                                 return progress.step < 4;
                               }));
    EXPECT_FALSE(fs::exists(out_ / name));
  }
}

TEST_F(FreeViewTest, BadInputIsSaidInASentence) {
  const Take take = ReadTake(out_ / "surface");
  EXPECT_MPC_ERROR(RenderSurface(ViewOfTake(take), take.video), kInvalidArgument, "overwritten");
  EXPECT_MPC_ERROR(RenderSurface(ViewOfTake(take), out_ / "none" / "a.mp4"), kWriteFailed, "none");
  Camera nowhere = clip_.camera;
  nowhere.has_extrinsics = false;
  WriteCameras(out_ / "nowhere.json", {nowhere});
  EXPECT_MPC_ERROR(ViewOfTake(take, {.camera = (out_ / "nowhere.json").string()}), kMismatch,
                   "no R and t");
  EXPECT_MPC_ERROR(ViewOfTake(take, {.camera = (out_ / "gone.json").string()}), kFileNotFound,
                   "gone.json");
  Take elsewhere = ReadTake(out_ / "take");
  elsewhere.camera.has_extrinsics = false;
  EXPECT_MPC_ERROR(ViewOfTake(elsewhere, {.camera = clip_.inputs.camera}), kMismatch,
                   "is not known");

  const std::string report = ReadFile(out_ / "surface" / "report.json");
  for (const std::string& bad :
       {std::string("{}"), report.substr(0, report.size() / 2),
        std::string(R"({"format":"mpc-report","world":{"world_from_camera":{"R":[[1,0],[0,1]],)"
                    R"("t":[0,0,0]}},"frames":[]})"),
        std::string(R"({"format":"mpc-report","frames":[],"world":{"world_from_camera":)"
                    R"({"R":[[1,0,0],[0,2,0],[0,0,1]],"t":[0,0,0]}}})")}) {
    WriteFileAtomically(out_ / "surface" / "report.json", bad);
    EXPECT_MPC_ERROR(ViewOfTake(take), kBadFile, "report.json");
  }
  fs::remove(out_ / "surface" / "report.json");
  EXPECT_MPC_ERROR(ViewOfTake(take), kFileNotFound, "report.json");
  Pc2Writer other(out_ / "surface" / "surface.pc2", 3);
  other.Close();
  EXPECT_MPC_ERROR(ViewOfTake(take), kMismatch, "3 vertices");
}

}  // namespace
}  // namespace mpc
