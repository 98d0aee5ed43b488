#include "mpc/refinement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "drawn_clip.h"
#include "mpc/eval/metrics.h"

namespace mpc {
namespace {

using testing::DrawnClip;

struct Delivered {
  std::vector<Eigen::Matrix3Xf> vertices;
  std::vector<Eigen::VectorXd> poses;
  std::vector<cv::Mat> masks;
  ClipRefinement refinement;
};

// The clip's poses stand 2 cm beside the person in its pictures.
class RefinementTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { clip_ = new DrawnClip(); }
  static void TearDownTestSuite() { delete clip_; }

  static Delivered Refine(const PosedClip& clip, const ClipRefinementOptions& options,
                          const ProgressCallback& progress = {}) {
    Delivered delivered;
    const auto keep = [&](const RefinedFrame& frame) {
      EXPECT_EQ(frame.index, static_cast<int>(delivered.vertices.size()));
      delivered.vertices.push_back(frame.vertices);
      delivered.poses.push_back(frame.pose);
      delivered.masks.push_back(frame.silhouette.clone());
    };
    delivered.refinement = RefineClip(clip, options, keep, progress);
    return delivered;
  }

  static PosedClip WithTruth() {
    PosedClip clip = clip_->clip();
    clip.true_masks = clip_->true_masks;
    return clip;
  }

  static double RootError(const Eigen::MatrixXd& poses) {
    return (poses.topRows<2>() - clip_->true_poses.topRows<2>()).colwise().norm().mean();
  }

  static const DrawnClip* clip_;
};
const DrawnClip* RefinementTest::clip_ = nullptr;

TEST_F(RefinementTest, EveryStepComesNearerToThePerson) {
  const Delivered result = Refine(WithTruth(), {});
  const int num_frames = static_cast<int>(clip_->poses.cols());
  ASSERT_EQ(result.refinement.frames.size(), static_cast<size_t>(num_frames));
  ASSERT_EQ(result.vertices.size(), static_cast<size_t>(num_frames));
  double batch = 0, model = 0, surface = 0, silhouettes = 0;
  for (const RefinementRecord& record : result.refinement.frames) {
    EXPECT_EQ(record.pose_state, RefinementState::kRefined);
    EXPECT_EQ(record.surface_state, RefinementState::kRefined);
    batch += record.batch_true_iou / num_frames;
    model += record.silhouette.model_true_iou / num_frames;
    surface += record.surface_true_iou / num_frames;
    silhouettes += record.silhouette.true_iou / num_frames;
  }
  EXPECT_LT(batch, 0.9);
  EXPECT_GT(model, batch + 0.03);
  EXPECT_GT(surface, model);
  EXPECT_GT(surface, silhouettes);  // the body knows more than the cut
  EXPECT_GT(silhouettes, 0.9);
  EXPECT_LT(RootError(result.refinement.poses), 0.5 * RootError(clip_->poses));
  for (int f = 0; f < num_frames; ++f) {
    EXPECT_EQ(result.refinement.poses.col(f), result.poses[static_cast<size_t>(f)]);
    const cv::Mat mask = MeshMask(clip_->camera, result.vertices[static_cast<size_t>(f)],
                                  clip_->character.mesh.triangles);
    EXPECT_NEAR(MaskIou(mask, clip_->truth[static_cast<size_t>(f)]),
                result.refinement.frames[static_cast<size_t>(f)].surface_true_iou, 1e-3);
  }
}

TEST_F(RefinementTest, ThreadsDoNotChangeTheResult) {
  ClipRefinementOptions options;
  options.silhouettes.num_threads = 1;
  const Delivered one = Refine(clip_->clip(), options);
  options.silhouettes.num_threads = 3;
  const Delivered three = Refine(clip_->clip(), options);
  EXPECT_EQ(one.refinement.poses, three.refinement.poses);
  ASSERT_EQ(one.vertices.size(), three.vertices.size());
  for (size_t f = 0; f < one.vertices.size(); ++f) {
    EXPECT_EQ(one.vertices[f], three.vertices[f]) << f;
    EXPECT_EQ(cv::countNonZero(one.masks[f] != three.masks[f]), 0) << f;
  }
}

TEST_F(RefinementTest, WithoutRefinementThePosesStayBitForBit) {
  ClipRefinementOptions options;
  options.frames.level = RefinementLevel::kNone;
  const Delivered result = Refine(clip_->clip(), options);
  EXPECT_EQ(result.refinement.poses, clip_->poses);
  KinematicState state;
  ForwardKinematics(clip_->character.skeleton, clip_->poses.col(4), &state);
  Eigen::Matrix3Xf skinned;
  SkinCharacter(clip_->character, state, &skinned);
  EXPECT_EQ(result.vertices[4], skinned);
  // The silhouettes are those of ExtractSilhouettes.
  std::vector<cv::Mat> masks;
  ExtractSilhouettes(clip_->clip(), {}, [&](const SilhouetteFrame& frame) {
    masks.push_back(frame.silhouette.mask.clone());
  });
  for (size_t f = 0; f < masks.size(); ++f) {
    EXPECT_EQ(cv::countNonZero(masks[f] != result.masks[f]), 0) << f;
  }
}

TEST_F(RefinementTest, PoseLevelLeavesTheSurfaceSkinned) {
  ClipRefinementOptions options;
  options.frames.level = RefinementLevel::kPose;
  const Delivered result = Refine(clip_->clip(), options);
  EXPECT_LT(RootError(result.refinement.poses), 0.5 * RootError(clip_->poses));
  KinematicState state;
  ForwardKinematics(clip_->character.skeleton, result.poses[4], &state);
  Eigen::Matrix3Xf skinned;
  SkinCharacter(clip_->character, state, &skinned);
  EXPECT_EQ(result.vertices[4], skinned);
}

TEST_F(RefinementTest, GivenMasksAreTheSilhouettes) {
  PosedClip clip = clip_->clip();
  clip.masks = clip_->true_masks;
  const Delivered result = Refine(clip, {});
  for (size_t f = 0; f < result.masks.size(); ++f) {
    EXPECT_EQ(result.refinement.frames[f].silhouette.state, SilhouetteState::kExternal);
    EXPECT_EQ(cv::countNonZero(result.masks[f] != clip_->truth[f]), 0) << f;
  }
}

TEST_F(RefinementTest, CanBeStopped) {
  ClipRefinementOptions options;
  options.silhouettes.num_threads = 1;
  const Delivered result =
      Refine(clip_->clip(), options, [](const Progress& progress) { return progress.step < 5; });
  EXPECT_LT(result.vertices.size(), 5u);
  EXPECT_EQ(result.refinement.frames.size(), result.vertices.size());
}

TEST_F(RefinementTest, LargePicturesAreLookedAtInASmallerSize) {
  const DrawnClip large(9, 0, 2);
  PosedClip clip = large.clip();
  clip.true_masks = large.true_masks;
  ClipRefinementOptions options;
  options.person_px = 100;  // the person is about 300 px tall
  const Delivered result = Refine(clip, options);
  const int num_frames = static_cast<int>(large.poses.cols());
  ASSERT_EQ(result.masks.size(), static_cast<size_t>(num_frames));
  EXPECT_LT(RootError(result.refinement.poses), 0.6 * RootError(large.poses));
  double batch = 0, surface = 0;
  for (int f = 0; f < num_frames; ++f) {
    const RefinementRecord& record = result.refinement.frames[static_cast<size_t>(f)];
    const cv::Mat& truth = large.truth[static_cast<size_t>(f)];
    const cv::Mat mask = MeshMask(large.camera, result.vertices[static_cast<size_t>(f)],
                                  large.character.mesh.triangles);
    EXPECT_NEAR(MaskIou(mask, truth), record.surface_true_iou, 1e-3);
    EXPECT_EQ(MaskIou(result.masks[static_cast<size_t>(f)], truth), record.silhouette.true_iou);
    batch += record.batch_true_iou / num_frames;
    surface += record.surface_true_iou / num_frames;
  }
  EXPECT_GT(surface, batch + 0.05);
  options.person_px = 0;
  EXPECT_FALSE(result.vertices[0] == Refine(clip, options).vertices[0]);  // it was another size
}

TEST_F(RefinementTest, OneFrameIsAClip) {
  DrawnClip one(1);
  const ClipRefinement result = RefineClip(one.clip(), {}, [](const RefinedFrame&) {});
  EXPECT_EQ(result.frames.size(), 1u);
  EXPECT_TRUE(result.poses.allFinite());
}

TEST_F(RefinementTest, HoldsPosesFromBetterDetectionsMoreFirmly) {
  PosedClip clip = clip_->clip();
  const auto moved = [&](double error_2d_mm) {
    clip.error_2d_mm = error_2d_mm;
    return (Refine(clip, {}).refinement.poses - clip.poses).topRows<3>().norm();
  };
  const double usual = moved(20);
  EXPECT_EQ(moved(7), usual);
  EXPECT_LT(moved(2), 0.5 * usual);
}

}  // namespace
}  // namespace mpc
