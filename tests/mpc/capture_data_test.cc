// The real clips, by the ordinary way: errors below the bars of docs/results.md.

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <string>

#include "io/temp_dir.h"
#include "mpc/eval/metrics.h"
#include "mpc/io/joint_truth_file.h"
#include "mpc/io/mask_file.h"
#include "mpc/mpc.h"
#include "support/data_dir.h"

namespace mpc {
namespace {

struct Scores {
  double pa_mpjpe_mm = 0;
  double jitter_mm_per_frame2 = 0;
};

Scores CaptureAndScore(const std::string& camera, bool fit_proportions) {
  const std::filesystem::path data = *testing::DataDir();
  const std::filesystem::path clip = data / "pose2sim";
  const testing::TempDir out;
  CaptureOptions options;
  options.overlay = false;
  options.masks = false;
  options.pose.fit_proportions = fit_proportions;
  Capture({.video = clip / (camera + ".mp4"),
           .actor = data / "actors" / "male_tpose.glb",
           .camera = (clip / "cameras.json").string() + ":" + camera,
           .detections2d = clip / (camera + "_openpose_body25b.json"),
           .detections3d = clip / (camera + "_blazepose.json")},
          out.path(), options)
      .Run();
  const JointTrack estimate = ReadJointTrack(out / "joints.trc");
  const JointTrack truth = ReadJointTrack(clip / "gt_joints.json");
  const auto joints = ScoredJoints14();
  const Eigen::MatrixXd estimated = SelectJoints(estimate.positions, estimate.joints, joints);
  const JointErrors errors =
      CompareJoints(joints, estimated, SelectJoints(truth.positions, truth.joints, joints));
  const std::string figures = FormatJointErrors(errors);
  std::printf("%s, proportions %s\n%s", camera.c_str(), fit_proportions ? "auto" : "off",
              figures.c_str());
  EXPECT_EQ(errors.similarity.num_frames, 99);
  return {errors.similarity.mean_mm, Jitter(estimated, estimate.fps).mean_mm_per_frame2};
}

// Captured by one camera and drawn into the other's picture, the person is where that one sees it.
// The two differ by what one camera cannot know: the size, and so the distance, of the person.
TEST(RealClipFromAside, ThePersonIsWhereTheOtherCameraSeesIt) {
  MPC_REQUIRE_DATA();
  const std::filesystem::path clip = *testing::DataDir() / "pose2sim";
  const std::string cameras = (clip / "cameras.json").string();
  const testing::TempDir out;
  CaptureOptions options;
  options.overlay = options.masks = false;
  Capture({.video = clip / "cam01.mp4",
           .actor = *testing::DataDir() / "actors" / "male_tpose.glb",
           .camera = cameras + ":cam01",
           .detections2d = clip / "cam01_openpose_body25b.json",
           .detections3d = clip / "cam01_blazepose.json"},
          out / "take", options)
      .Run();
  const Take take = ReadTake(out / "take");
  for (const auto& [name, bar] : {std::pair("cam01", 0.6), std::pair("cam03", 0.4)}) {
    const ViewedSurface view = ViewOfTake(take, {.camera = cameras + ":" + name});
    ASSERT_TRUE(RenderSurface(view, out / "masks", {.mask = true}));
    MaskReader drawn(out / "masks", view.camera.width, view.camera.height);
    MaskReader truth(clip / "masks" / name, view.camera.width, view.camera.height);
    std::vector<double> iou;
    for (cv::Mat a, b; drawn.Read(&a) && truth.Read(&b);) iou.push_back(MaskIou(a, b));
    const IouSummary summary = SummarizeIou(iou);
    std::printf("%s: IoU with its masks %.3f, worst tenth %.3f\n", name, summary.mean,
                summary.worst_decile);
    EXPECT_EQ(summary.num_frames, 100);
    EXPECT_GT(summary.mean, bar);
  }
}

class RealClip : public ::testing::TestWithParam<const char*> {};

TEST_P(RealClip, ErrorsStayBelowTheBars) {
  MPC_REQUIRE_DATA();
  const Scores fitted = CaptureAndScore(GetParam(), /*fit_proportions=*/true);
  EXPECT_LE(fitted.pa_mpjpe_mm, 66);
  EXPECT_LT(fitted.jitter_mm_per_frame2, 29.0 / 3);
  const Scores as_given = CaptureAndScore(GetParam(), /*fit_proportions=*/false);
  EXPECT_LE(as_given.pa_mpjpe_mm, 78);
  EXPECT_LT(as_given.jitter_mm_per_frame2, 29.0 / 3);
}

INSTANTIATE_TEST_SUITE_P(Pose2Sim, RealClip, ::testing::Values("cam01", "cam03"));

}  // namespace
}  // namespace mpc
