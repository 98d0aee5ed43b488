#include "clip_view.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/eval/dressed_actor.h"
#include "mpc/eval/metrics.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc::internal {
namespace {

// An actor about 1.8 m tall, `depth` metres from a camera with f = 1000 px.
class ClipViewTest : public ::testing::Test {
 protected:
  ClipViewTest() {
    camera_.width = 1000;
    camera_.height = 1600;
    camera_.fx = camera_.fy = 1000;
    camera_.cx = 480;
    camera_.cy = 820;
    camera_.distortion[0] = 0.05;
    const RigAsset rig = MakeDressedActor().rig;
    character_ = BuildCharacter(rig, MapRigByNames(rig));
    poses_ = Eigen::MatrixXd::Zero(character_.skeleton.num_dofs(), 20);
    StandAt(2);
  }

  void StandAt(double depth) { poses_.row(2).setConstant(depth); }

  PosedClip clip() const {
    return {.video = "", .camera = camera_, .character = character_, .poses = poses_};
  }
  int NumHalvings(double person_px) const { return ClipView(clip(), person_px).num_halvings; }

  Camera camera_;
  Character character_;
  Eigen::MatrixXd poses_;
};

TEST_F(ClipViewTest, HalvesAsLongAsThePersonStaysTallEnough) {
  EXPECT_EQ(NumHalvings(0), 0);
  EXPECT_EQ(NumHalvings(400), 1);  // from 900 px to 450
  EXPECT_EQ(NumHalvings(500), 0);
  EXPECT_EQ(NumHalvings(200), 2);
  StandAt(4);
  EXPECT_EQ(NumHalvings(400), 0);
  StandAt(1);
  EXPECT_EQ(NumHalvings(400), 2);
}

TEST_F(ClipViewTest, SomebodyWhoGoesFarAwayIsSeenAsLargeAsThere) {
  poses_.block(2, 0, 1, 2).setConstant(8);  // two frames of twenty may be smaller
  EXPECT_EQ(NumHalvings(400), 1);
  poses_.block(2, 0, 1, 3).setConstant(8);
  EXPECT_EQ(NumHalvings(400), 0);
}

TEST_F(ClipViewTest, AnyPosesGiveAView) {
  for (const double depth : {0.0, -3.0, 1e-9}) {
    StandAt(depth);
    EXPECT_EQ(ClipView(clip(), 400).camera.width, 250);  // not smaller than 128
  }
  camera_.width = 257;  // odd, and nearly too small
  EXPECT_EQ(ClipView(clip(), 400).camera.width, 128);
  camera_.width = 255;
  EXPECT_EQ(NumHalvings(400), 0);
  poses_.resize(poses_.rows(), 0);
  EXPECT_EQ(NumHalvings(400), 0);
}

TEST_F(ClipViewTest, ItsCameraShowsWhatItsPicturesShow) {
  const ClipView view(clip(), 200);
  ASSERT_EQ(view.num_halvings, 2);
  cv::Mat picture(camera_.height, camera_.width, CV_8UC3, cv::Scalar::all(0));
  Eigen::Vector2d whole, small;
  const Eigen::Vector3d x(0.4, -0.9, 2.1);
  ASSERT_TRUE(Project(camera_, x, &whole));
  cv::circle(picture, cv::Point2d(whole.x(), whole.y()), 20, cv::Scalar::all(255), cv::FILLED);
  cv::Mat seen;
  cv::extractChannel(view.Look(picture), seen, 0);
  EXPECT_EQ(seen.size(), cv::Size(250, 400));
  ASSERT_TRUE(Project(view.camera, x, &small));
  const cv::Moments moments = cv::moments(seen);
  EXPECT_NEAR(moments.m10 / moments.m00, small.x(), 0.15);
  EXPECT_NEAR(moments.m01 / moments.m00, small.y(), 0.15);
}

TEST_F(ClipViewTest, PersonMasksLieInItsPictures) {
  std::vector<PersonMask> masks = {{.frame = 3,
                                    .region = {.center = {420, 700}, .size_px = 640},
                                    .probability = cv::Mat(64, 64, CV_8U, cv::Scalar(0))}};
  cv::circle(masks[0].probability, {20, 30}, 15, 255, cv::FILLED);
  PosedClip posed = clip();
  posed.person_masks = masks;
  const ClipView view(posed, 400);
  const cv::Mat small = PictureMask(view.person_masks[0], {view.camera.width, view.camera.height});
  const cv::Mat whole = PictureMask(masks[0], {camera_.width, camera_.height});
  EXPECT_GT(MaskIou(small > 127, view.Look(whole) > 127), 0.98);
}

TEST(EnlargedMask, KeepsPlaceAndShape) {
  cv::Mat whole(480, 360, CV_8U, cv::Scalar(0));
  cv::ellipse(whole, {{170, 250}, {120, 300}, 20}, 255, cv::FILLED);
  cv::Mat small;
  cv::resize(whole, small, {}, 0.25, 0.25, cv::INTER_AREA);
  const cv::Mat enlarged = EnlargedMask(small > 127, whole.size());
  EXPECT_EQ(enlarged.size(), whole.size());
  EXPECT_GT(MaskIou(enlarged, whole), 0.985);
  EXPECT_EQ(cv::countNonZero((enlarged != 0) & (enlarged != 255)), 0);
}

// Only what lies around the mask is looked at where the sizes are whole multiples: as all of it would be,
// at the picture's border too.
TEST(EnlargedMask, LosesNothingByLookingAroundTheMaskOnly) {
  cv::Mat small(90, 120, CV_8U, cv::Scalar(0));
  cv::circle(small, {6, 40}, 25, 255, cv::FILLED);
  cv::circle(small, {80, 50}, 9, 255, cv::FILLED);
  cv::Mat expected;
  cv::GaussianBlur(small, expected, {5, 5}, 1);
  for (const cv::Size& size : {cv::Size(240, 180), cv::Size(480, 360), cv::Size(241, 181)}) {
    cv::Mat large;
    cv::resize(expected, large, size, 0, 0, cv::INTER_LINEAR);
    EXPECT_GT(MaskIou(EnlargedMask(small, size), large > 127), 0.999) << size;
  }
}

TEST(EnlargedMask, OfNothingIsEmpty) {
  const cv::Mat nothing(48, 64, CV_8U, cv::Scalar(0));
  const cv::Mat enlarged = EnlargedMask(nothing, {128, 96});
  EXPECT_EQ(enlarged.size(), cv::Size(128, 96));
  EXPECT_EQ(cv::countNonZero(enlarged), 0);
}

}  // namespace
}  // namespace mpc::internal
