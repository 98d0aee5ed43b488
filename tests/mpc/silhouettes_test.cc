#include "mpc/silhouettes.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string>
#include <vector>

#include "drawn_clip.h"
#include "mpc/capture.h"
#include "mpc/eval/metrics.h"
#include "mpc/io/atomic_file.h"
#include "mpc/take.h"
#include "silhouette_maker.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;
using testing::DrawnClip;
using testing::SmallClip;
using testing::TempDir;
using ::testing::UnorderedElementsAre;

std::set<std::string> FilesIn(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    names.insert(entry.path().filename().string());
  }
  return names;
}

struct Extraction {
  std::vector<cv::Mat> masks;
  std::vector<cv::Mat> models;
  std::vector<SilhouetteRecord> records;
};

Extraction Extract(const PosedClip& clip, const SilhouetteOptions& options = {},
                   const ProgressCallback& progress = {}) {
  Extraction result;
  result.records = ExtractSilhouettes(
      clip, options,
      [&](const SilhouetteFrame& frame) {
        EXPECT_EQ(frame.index, static_cast<int>(result.masks.size()));
        EXPECT_EQ(frame.picture.size(), frame.silhouette.mask.size());
        result.masks.push_back(frame.silhouette.mask.clone());
        result.models.push_back(frame.model.clone());
      },
      progress);
  return result;
}

bool Same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && cv::countNonZero(a != b) == 0;
}

class SilhouettesTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { clip_ = new DrawnClip(); }
  static void TearDownTestSuite() { delete clip_; }

  // Masks of the right size: as many frames, each the truth or all black.
  fs::path WriteMasks(const char* name, int count) const {
    MaskFolderWriter writer(out_ / name);
    for (int f = 0; f < count; ++f) writer.Write(clip_->truth[static_cast<size_t>(f) % 9]);
    writer.Close();
    return out_ / name;
  }

  static const DrawnClip* clip_;
  TempDir out_;
};
const DrawnClip* SilhouettesTest::clip_ = nullptr;

TEST_F(SilhouettesTest, AreNearerToTheTruthThanTheModel) {
  PosedClip clip = clip_->clip();
  clip.true_masks = clip_->true_masks;
  const Extraction result = Extract(clip);
  ASSERT_EQ(result.masks.size(), clip_->truth.size());
  for (size_t f = 0; f < result.masks.size(); ++f) {
    const SilhouetteRecord& record = result.records[f];
    EXPECT_EQ(record.state, SilhouetteState::kCut);
    EXPECT_LT(record.model_true_iou, 0.85);
    EXPECT_GT(record.true_iou, 0.88) << f;
    EXPECT_EQ(record.true_iou, MaskIou(result.masks[f], clip_->truth[f]));
    EXPECT_EQ(record.model_true_iou, MaskIou(result.models[f], clip_->truth[f]));
    EXPECT_NEAR(record.model_iou, MaskIou(result.masks[f], result.models[f]), 1e-9);
  }
}

TEST_F(SilhouettesTest, DoNotDependOnTheNumberOfThreads) {
  SilhouetteOptions options;
  options.num_threads = 1;
  const Extraction one = Extract(clip_->clip(), options);
  for (const int num_threads : {2, 3, 16}) {
    options.num_threads = num_threads;
    const Extraction many = Extract(clip_->clip(), options);
    ASSERT_EQ(many.masks.size(), one.masks.size());
    for (size_t f = 0; f < one.masks.size(); ++f) {
      EXPECT_TRUE(Same(many.masks[f], one.masks[f])) << num_threads << " threads, frame " << f;
      EXPECT_EQ(many.records[f].confidence, one.records[f].confidence);
    }
  }
}

TEST_F(SilhouettesTest, SeeTheBackgroundWhereTheActorHasBeen) {
  const DrawnClip walk(9, 0.25);
  const auto see = [](const PosedClip& clip, const SilhouetteOptions& options = {}) {
    const auto view =
        internal::BackgroundView::See(clip, internal::ClipView(clip), options, "silhouettes", {});
    return view ? std::optional(view->At(0)) : std::nullopt;
  };
  const std::optional<BackgroundPlate> plate = see(walk.clip());
  ASSERT_TRUE(plate);
  const cv::Mat known = plate->spread != BackgroundPlate::kUnknown;
  EXPECT_GT(cv::countNonZero(known), 0.98 * static_cast<double>(known.total()));
  cv::Mat difference;
  cv::absdiff(plate->picture, walk.background, difference);
  const cv::Scalar mean = cv::mean(difference, known);
  EXPECT_LT((mean[0] + mean[1] + mean[2]) / 3, 8);  // the coder leaves little of the noise

  // One who stays hides it.
  const std::optional<BackgroundPlate> still = see(clip_->clip());
  ASSERT_TRUE(still);
  EXPECT_EQ(still->spread.at<uint8_t>(DrawnClip::kHeight / 2, DrawnClip::kWidth / 2),
            BackgroundPlate::kUnknown);

  // With masks of the user's own, and in the paper, nothing is looked at.
  PosedClip given = walk.clip();
  given.masks = walk.true_masks;
  EXPECT_TRUE(see(given)->empty());
  EXPECT_TRUE(see(walk.clip(), SilhouetteOptions::Paper())->empty());
}

TEST(BackgroundFramesTest, LieEvenlyOverTheClip) {
  EXPECT_TRUE(BackgroundFrames(-1).empty());
  EXPECT_TRUE(BackgroundFrames(0).empty());
  EXPECT_EQ(BackgroundFrames(3), (std::vector<int>{0, 1, 2}));
  for (const int num_frames : {1, 24, 25, 100, 101, 200000000}) {
    const std::vector<int> frames = BackgroundFrames(num_frames);
    ASSERT_EQ(frames.size(), std::min(num_frames, 24));
    EXPECT_EQ(frames.front(), 0);
    for (size_t i = 0; i < frames.size(); ++i) {
      const double even = static_cast<double>(i) * num_frames / static_cast<double>(frames.size());
      EXPECT_GE(frames[i], even);
      EXPECT_LT(frames[i], even + 1);
    }
  }
}

TEST_F(SilhouettesTest, SeeTheSameBackgroundInPicturesThatWereKept) {
  const DrawnClip walk(30, 0.25);
  PosedClip clip = walk.clip();
  const auto see = [&] {
    const auto view =
        internal::BackgroundView::See(clip, internal::ClipView(clip), {}, "silhouettes", {});
    return view ? view->At(0) : BackgroundPlate();
  };
  const BackgroundPlate read = see();
  std::vector<cv::Mat> kept;
  VideoReader video(walk.video);
  for (const int f : BackgroundFrames(30)) {
    cv::Mat picture;
    while (video.frame_index() < f) ASSERT_TRUE(video.Read(&picture));
    kept.push_back(picture);
  }
  const std::vector<cv::Mat> all = kept;
  clip.background = &kept;
  const BackgroundPlate twin = see();
  EXPECT_TRUE(kept.empty());
  EXPECT_TRUE(Same(twin.picture.reshape(1), read.picture.reshape(1)));
  EXPECT_TRUE(Same(twin.spread, read.spread));

  // They are looked at, and not for another clip.
  kept.assign(24, all[0]);
  EXPECT_FALSE(Same(see().spread, read.spread));
  kept.assign(23, all[0]);
  EXPECT_TRUE(Same(see().spread, read.spread));
}

// A camera that turns by known angles before a wall with a picture on it, and an actor who stays in view.
TEST_F(SilhouettesTest, SeeTheBackgroundOfACameraThatTurns) {
  const Camera& camera = clip_->camera;
  const auto num_frames = static_cast<int>(clip_->poses.cols());
  const cv::Matx33d k(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  cv::Mat wall(900, 1400, CV_8UC3);
  cv::RNG(5).fill(wall, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(wall, wall, {0, 0}, 6);
  cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
  const cv::Matx33d picture_from_wall(1, 0, -580, 0, 1, -300, 0, 0, 1);
  const TempDir folder;
  std::vector<CameraFromWorld> motion;
  std::vector<cv::Mat> pictures;
  for (int f = 0; f < num_frames; ++f) {
    const double yaw = 0.06 * (f - 2), pitch = 0.02 * f;
    motion.emplace_back();
    motion.back().rotation = (Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) *
                              Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()))
                                 .toRotationMatrix();
    motion.back().translation.setZero();
    cv::Matx33d turn;
    cv::eigen2cv(motion.back().rotation, turn);
    cv::Mat picture;
    cv::warpPerspective(wall, picture, k * turn * k.inv() * picture_from_wall,
                        {camera.width, camera.height});
    cv::imwrite(folder / fmt::format("{:03d}.png", f), picture);
    pictures.push_back(picture);
  }
  PosedClip clip = clip_->clip();
  clip.video = folder.path();
  clip.image_fps = 25;
  const auto difference = [&](const internal::BackgroundView& view, int f) {
    const BackgroundPlate plate = view.At(f);
    const cv::Mat known = plate.spread < 20;
    EXPECT_GT(cv::countNonZero(known), 0.5 * static_cast<double>(known.total()));
    cv::Mat off;
    cv::absdiff(plate.picture, pictures[static_cast<size_t>(f)], off);
    const cv::Scalar mean = cv::mean(off, known);
    return (mean[0] + mean[1] + mean[2]) / 3;
  };
  clip.camera_motion = motion;
  const auto view =
      internal::BackgroundView::See(clip, internal::ClipView(clip), {}, "silhouettes", {});
  ASSERT_TRUE(view);
  for (const int f : {0, num_frames / 2, num_frames - 1}) EXPECT_LT(difference(*view, f), 3);
  EXPECT_FALSE(view->rests());

  // One look to the other side of the room belongs to no plate.
  motion[1].rotation = Eigen::AngleAxisd(3, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const auto without =
      internal::BackgroundView::See(clip, internal::ClipView(clip), {}, "silhouettes", {});
  ASSERT_TRUE(without);
  EXPECT_TRUE(without->At(1).empty());
  EXPECT_LT(difference(*without, 0), 3);

  // Nobody has to say that it turns for it not to rest, be it in one picture.
  clip.camera_motion = {};
  for (int f = 0; f < num_frames; ++f) {
    const size_t shown = f == num_frames / 2 ? 1 : 0;
    cv::imwrite(folder / fmt::format("{:03d}.png", f), pictures[shown]);
  }
  const auto nudged =
      internal::BackgroundView::See(clip, internal::ClipView(clip), {}, "silhouettes", {});
  ASSERT_TRUE(nudged);
  EXPECT_FALSE(nudged->rests());
  for (int f = 0; f < num_frames; ++f) {
    cv::imwrite(folder / fmt::format("{:03d}.png", f), pictures[0]);
  }
  const auto resting =
      internal::BackgroundView::See(clip, internal::ClipView(clip), {}, "silhouettes", {});
  ASSERT_TRUE(resting);
  EXPECT_TRUE(resting->rests());
}

TEST_F(SilhouettesTest, StopBeforeTheFirstFrame) {
  int num_calls = 0;
  const Extraction result = Extract(clip_->clip(), {}, [&](const Progress& progress) {
    EXPECT_EQ(progress.step, 0);
    return ++num_calls < 3;
  });
  EXPECT_EQ(num_calls, 3);
  EXPECT_TRUE(result.records.empty());
  EXPECT_TRUE(result.masks.empty());
}

TEST_F(SilhouettesTest, OneFrameIsEnough) {
  const DrawnClip single(1);
  const Extraction result = Extract(single.clip());
  ASSERT_EQ(result.masks.size(), 1u);
  EXPECT_GT(MaskIou(result.masks[0], single.truth[0]), 0.88);
  EXPECT_TRUE(std::isnan(result.records[0].true_iou));
}

TEST_F(SilhouettesTest, PaperPresetRuns) {
  const DrawnClip two(2);
  const Extraction result = Extract(two.clip(), SilhouetteOptions::Paper());
  ASSERT_EQ(result.masks.size(), 2u);
  EXPECT_GT(MaskIou(result.masks[1], two.truth[1]), 0.7);
}

TEST_F(SilhouettesTest, ActorsOutsideThePictureAreDefined) {
  for (const double shift_m : {0.9, 30.0}) {
    Eigen::MatrixXd poses = clip_->poses;
    poses.row(0).array() += shift_m;
    PosedClip clip = {.video = clip_->video,
                      .camera = clip_->camera,
                      .character = clip_->character,
                      .poses = poses};
    const Extraction result = Extract(clip);
    ASSERT_EQ(result.masks.size(), clip_->truth.size());
    if (shift_m < 10) continue;
    for (size_t f = 0; f < result.masks.size(); ++f) {
      EXPECT_EQ(result.records[f].state, SilhouetteState::kNoModel);
      EXPECT_EQ(cv::countNonZero(result.masks[f]), 0);
    }
  }
}

TEST_F(SilhouettesTest, GivenMasksTakeTheirPlace) {
  PosedClip clip = clip_->clip();
  clip.masks = clip_->true_masks;
  const Extraction result = Extract(clip);
  ASSERT_EQ(result.masks.size(), clip_->truth.size());
  for (size_t f = 0; f < result.masks.size(); ++f) {
    EXPECT_TRUE(Same(result.masks[f], clip_->truth[f]));
    EXPECT_EQ(result.records[f].state, SilhouetteState::kExternal);
    EXPECT_EQ(result.records[f].model_iou, MaskIou(result.models[f], clip_->truth[f]));
  }
}

TEST_F(SilhouettesTest, MasksMustBeOfThisClip) {
  for (const bool given : {true, false}) {
    PosedClip clip = clip_->clip();
    fs::path& masks = given ? clip.masks : clip.true_masks;
    masks = WriteMasks("few", 7);
    EXPECT_MPC_ERROR(Extract(clip), kMismatch, "few has 7 frames, but the actor has 9 poses");
    masks = WriteMasks("many", 10);
    EXPECT_MPC_ERROR(Extract(clip), kMismatch, "many has more frames than the actor's 9 poses");
    masks = out_ / "none";
    EXPECT_MPC_ERROR(Extract(clip), kFileNotFound, "none");
    masks = out_ / "other";
    MaskFolderWriter writer(masks);
    writer.Write(cv::Mat::zeros(20, 16, CV_8UC1));
    writer.Close();
    EXPECT_MPC_ERROR(Extract(clip), kMismatch, "16 x 20");
  }
}

TEST_F(SilhouettesTest, VideosMustBeOfThesePoses) {
  PosedClip clip = clip_->clip();
  const Eigen::MatrixXd few = clip_->poses.leftCols(5);
  EXPECT_MPC_ERROR(
      Extract(
          {.video = clip.video, .camera = clip.camera, .character = clip.character, .poses = few}),
      kMismatch, "more frames");
  const Camera other = clip_->camera.ScaledTo(480, 600);
  EXPECT_MPC_ERROR(
      Extract(
          {.video = clip.video, .camera = other, .character = clip.character, .poses = clip.poses}),
      kMismatch, "480 x 600");
  SilhouetteOptions options;
  options.limb_thickness = -1;
  EXPECT_MPC_ERROR(Extract(clip, options), kInvalidArgument, "limb_thickness");
}

TEST_F(SilhouettesTest, StopWhenAsked) {
  SilhouetteOptions options;
  options.num_threads = 1;
  const Extraction result =
      Extract(clip_->clip(), options, [](const Progress& progress) { return progress.step < 4; });
  EXPECT_EQ(result.records.size(), 4u);
  EXPECT_EQ(result.masks.size(), 4u);
}

// ---- In a capture, and from its folder ----------------------------------------------------------

class TakeTest : public ::testing::Test {
 protected:
  TakeTest() {
    CaptureInputs inputs = clip_.inputs;
    CaptureOptions options;
    options.overlay = false;
    options.pose.num_threads = 1;
    // So that the masks are those of the poses in the folder.
    options.refinement.frames.level = RefinementLevel::kNone;
    report_ = Capture(inputs, folder(), options).Run();
  }
  fs::path folder() const { return out_ / "take"; }

  SmallClip clip_{12};
  TempDir out_;
  CaptureReport report_;
};

TEST_F(TakeTest, IsThePosedActorAgain) {
  const Take take = ReadTake(folder());
  EXPECT_EQ(take.poses, report_.track.poses);
  EXPECT_EQ(take.camera.fx, report_.camera.fx);
  EXPECT_EQ(take.fps, SmallClip::kFps);
  EXPECT_TRUE(take.video.is_absolute());
  const Eigen::MatrixXd before = JointTrajectories(report_.skeleton, report_.track.poses);
  EXPECT_EQ(JointTrajectories(take.character.skeleton, take.poses), before);
}

TEST_F(TakeTest, SegmentWritesTheMasksOfTheCapture) {
  SegmentOptions options;
  options.pictures = true;
  const SegmentReport report = SegmentTake(ReadTake(folder()), out_ / "again", options);
  EXPECT_TRUE(report.complete);
  EXPECT_EQ(report.frames.size(), 12u);
  EXPECT_THAT(FilesIn(out_ / "again"),
              UnorderedElementsAre("masks.mp4", "masks", "overlay.mp4", "silhouettes.json"));
  EXPECT_EQ(ReadFile(out_ / "again" / "masks.mp4"), ReadFile(folder() / "masks.mp4"));
  EXPECT_EQ(FilesIn(out_ / "again" / "masks").size(), 12u);
  EXPECT_EQ(VideoReader(out_ / "again" / "overlay.mp4").num_frames(), 12);
  const nlohmann::json json = nlohmann::json::parse(ReadFile(out_ / "again" / "silhouettes.json"));
  EXPECT_EQ(json["format"], "mpc-silhouettes");
  EXPECT_EQ(json["complete"], true);
  EXPECT_TRUE(json["true_iou"]["silhouettes"].is_null());
  ASSERT_EQ(json["frames"].size(), 12u);
  const nlohmann::json captured = nlohmann::json::parse(ReadFile(folder() / "report.json"));
  for (size_t f = 0; f < 12; ++f) {
    EXPECT_EQ(json["frames"][f], captured["frames"][f]["silhouette"]);
  }
}

TEST_F(TakeTest, SegmentComparesWithTrueMasks) {
  SegmentOptions options;
  options.true_masks = folder() / "masks.mp4";
  options.overlay = false;
  const SegmentReport report = SegmentTake(ReadTake(folder()), out_ / "again", options);
  for (const SilhouetteRecord& record : report.frames) EXPECT_GT(record.true_iou, 0.999);
  EXPECT_THAT(FilesIn(out_ / "again"), UnorderedElementsAre("masks.mp4", "silhouettes.json"));
}

TEST_F(TakeTest, StoppedSegmentLeavesOnlyAReport) {
  SegmentOptions options;
  options.pictures = true;
  options.silhouettes.num_threads = 1;
  const SegmentReport report = SegmentTake(ReadTake(folder()), out_ / "again", options,
                                           [](const Progress&) { return false; });
  EXPECT_FALSE(report.complete);
  EXPECT_THAT(FilesIn(out_ / "again"), UnorderedElementsAre("silhouettes.json"));
}

TEST_F(TakeTest, SegmentNeverOverwritesWhatItReads) {
  const Take take = ReadTake(folder());
  EXPECT_MPC_ERROR(SegmentTake(take, folder()), kInvalidArgument, "is a capture folder");
  SegmentOptions options;
  options.pictures = true;
  SegmentTake(take, out_ / "a", options);
  options.true_masks = out_ / "a" / "masks";
  EXPECT_MPC_ERROR(SegmentTake(take, out_ / "a", options), kInvalidArgument, "overwritten");
  out_.Write("file", "x");
  EXPECT_MPC_ERROR(SegmentTake(take, out_ / "file"), kWriteFailed, "not a folder");
}

TEST_F(TakeTest, WhatIsMissingIsSaid) {
  EXPECT_MPC_ERROR(ReadTake(out_ / "none"), kFileNotFound, "poses.json");
  EXPECT_MPC_ERROR(ReadTake(folder(), {}, out_ / "none.glb"), kFileNotFound, "none.glb");
  EXPECT_MPC_ERROR(SegmentTake(ReadTake(folder(), out_ / "none.mp4"), out_ / "again"),
                   kFileNotFound, "none.mp4");
  const fs::path moved = out_ / "moved.mp4";
  fs::rename(clip_.inputs.video, moved);
  EXPECT_MPC_ERROR(SegmentTake(ReadTake(folder()), out_ / "again"), kFileNotFound, "clip.mp4");
  EXPECT_TRUE(SegmentTake(ReadTake(folder(), moved), out_ / "again").complete);
}

}  // namespace
}  // namespace mpc
