#include "mpc/seg/silhouette.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "mpc/core/thread_pool.h"
#include "simulated_masks.h"
#include "support/expect_error.h"
#include "test_scene.h"

namespace mpc {
namespace {

using mpc::testing::DrawFigure;
using mpc::testing::MakeScene;
using mpc::testing::MaskIou;
using mpc::testing::TestScene;
using mpc::testing::TestSceneOptions;
using mpc::testing::WrongModel;

struct Case {
  TestScene scene;
  FrameInput frame;
};

Case MakeCase(const TestSceneOptions& options = {}, double model_shift = 0.025) {
  Case c;
  c.scene = MakeScene(options);
  TestSceneOptions before = options;
  before.centre += cv::Point2d(0.04 * options.height, 0.02 * options.height);
  before.seed += 1;
  c.frame.picture = c.scene.picture;
  c.frame.previous = MakeScene(before).picture;
  c.frame.model_mask = WrongModel(options, model_shift);
  c.frame.skeleton_mask = c.scene.skeleton;
  return c;
}

// What holds for every result, whatever came in.
void ExpectDefined(const Silhouette& s, const FrameInput& frame) {
  ASSERT_EQ(s.mask.type(), CV_8UC1);
  ASSERT_EQ(s.mask.size(), frame.picture.size());
  EXPECT_EQ(cv::countNonZero((s.mask != 0) & (s.mask != 255)), 0);
  cv::Mat outside = s.mask.clone();
  if (!s.roi.empty()) outside(s.roi).setTo(0);
  EXPECT_EQ(cv::countNonZero(outside), 0);
  EXPECT_GE(s.confidence, 0);
  EXPECT_LE(s.confidence, 1);
  EXPECT_GE(s.model_iou, 0);
  EXPECT_LE(s.model_iou, 1);
}

TEST(Silhouette, CorrectsAWrongModel) {
  const Case c = MakeCase();
  const Silhouette s = ExtractSilhouette(c.frame);
  ExpectDefined(s, c.frame);
  EXPECT_EQ(s.state, SilhouetteState::kCut);
  EXPECT_TRUE(s.motion_cue);
  EXPECT_FALSE(s.camera_motion);
  EXPECT_LT(MaskIou(c.frame.model_mask, c.scene.truth), 0.8);
  EXPECT_GT(MaskIou(s.mask, c.scene.truth), 0.97);
  EXPECT_GT(s.confidence, 0.5);
  EXPECT_NEAR(s.model_iou, MaskIou(s.mask, c.frame.model_mask), 1e-12);
}

TEST(Silhouette, StaysWithinTheTrimap) {
  SegmentationOptions options;
  options.clip_skeleton = false;
  options.clean = false;
  const Case c = MakeCase();
  const Silhouette s = ExtractSilhouette(c.frame, options);
  const double size = ActorSizePx(c.frame.model_mask);
  // The chamfer distance used inside is right to 2 %.
  const cv::Mat wide = MakeTrimap(c.frame.skeleton_mask, c.frame.model_mask,
                                  {0.7 * options.erode * size, 1.03 * options.dilate * size});
  const cv::Mat narrow =
      MakeTrimap({}, c.frame.model_mask, {1.03 * options.erode * size + 1, options.dilate * size});
  EXPECT_EQ(cv::countNonZero((wide == kTrimapBackground) & (s.mask != 0)), 0);
  EXPECT_EQ(cv::countNonZero((narrow == kTrimapForeground) & (s.mask == 0)), 0);
}

TEST(Silhouette, CoarseToFineAgreesWithTheWholeCrop) {
  TestSceneOptions scene;
  scene.size = {720, 960};
  scene.centre = {360, 480};
  scene.height = 800;
  const Case c = MakeCase(scene);
  SegmentationOptions whole;
  whole.max_cut_size_px = 0;
  const Silhouette banded = ExtractSilhouette(c.frame);
  const Silhouette full = ExtractSilhouette(c.frame, whole);
  EXPECT_GT(MaskIou(full.mask, c.scene.truth), 0.98);
  EXPECT_GT(MaskIou(banded.mask, c.scene.truth), 0.98);
  EXPECT_GT(MaskIou(banded.mask, full.mask), 0.985);
}

TEST(Silhouette, CutSmallerItIsNearlyAsGood) {
  TestSceneOptions scene;
  scene.size = {720, 960};
  scene.centre = {360, 480};
  scene.height = 800;
  const Case c = MakeCase(scene);
  SegmentationOptions options;
  const Silhouette usual = ExtractSilhouette(c.frame, options);
  options.max_cut_size_px = 60;
  const Silhouette small = ExtractSilhouette(c.frame, options);
  EXPECT_GT(cv::countNonZero(small.mask != usual.mask), 0);
  EXPECT_GT(MaskIou(small.mask, c.scene.truth), MaskIou(usual.mask, c.scene.truth) - 0.005);
}

TEST(Silhouette, ScalesWithThePicture) {
  for (const double scale : {0.25, 0.5, 2.0, 4.0}) {
    TestSceneOptions options;
    options.size = {cvRound(240 * scale), cvRound(320 * scale)};
    options.centre *= scale;
    options.height *= scale;
    const Case c = MakeCase(options);
    const Silhouette s = ExtractSilhouette(c.frame);
    ExpectDefined(s, c.frame);
    EXPECT_GT(MaskIou(s.mask, c.scene.truth), scale < 0.5 ? 0.85 : 0.95) << scale;
  }
}

TEST(Silhouette, SameResultEveryTimeAndOnEveryThread) {
  const Case c = MakeCase();
  const Silhouette first = ExtractSilhouette(c.frame);
  std::vector<Silhouette> others(6);
  ParallelFor(6, 3, [&](int i) { others[static_cast<size_t>(i)] = ExtractSilhouette(c.frame); });
  for (const Silhouette& s : others) {
    EXPECT_EQ(cv::countNonZero(s.mask != first.mask), 0);
    EXPECT_EQ(s.confidence, first.confidence);
  }
}

TEST(Silhouette, MovingCameraIsTakenOut) {
  TestSceneOptions options;
  const TestScene now = MakeScene(options);
  TestSceneOptions before = options;
  before.camera = {-9, 6};
  before.centre += cv::Point2d(10, 0);
  before.seed = 2;
  TestSceneOptions after = options;
  after.camera = {6, 3};
  after.seed = 3;
  FrameInput frame;
  frame.picture = now.picture;
  frame.previous = MakeScene(before).picture;
  frame.next = MakeScene(after).picture;
  frame.model_mask = WrongModel(options, 0.025);
  frame.skeleton_mask = now.skeleton;
  const Silhouette s = ExtractSilhouette(frame);
  EXPECT_TRUE(s.camera_motion);
  ASSERT_TRUE(s.previous_from_current);
  EXPECT_NEAR((*s.previous_from_current)(0, 2), -9, 1);
  EXPECT_NEAR((*s.previous_from_current)(1, 2), 6, 1);
  ASSERT_TRUE(s.next_from_current);
  EXPECT_NEAR((*s.next_from_current)(0, 2), 6, 1);
  EXPECT_NEAR((*s.next_from_current)(1, 2), 3, 1);
  EXPECT_GT(MaskIou(s.mask, now.truth), 0.96);
}

TEST(Silhouette, KnownMotionGivesTheStillCamerasResult) {
  for (const double scale : {1.0, 3.0}) {
    TestSceneOptions options;
    options.size = {cvRound(240 * scale), cvRound(320 * scale)};
    options.centre *= scale;
    options.height *= scale;
    options.same_texture = true;  // so that motion matters
    FrameInput still = MakeCase(options, 0.03).frame;
    const Silhouette expected = ExtractSilhouette(still);
    FrameInput panned = still;
    const cv::Matx23d pan(1, 0, -8, 0, 1, 4);
    cv::warpAffine(still.previous, panned.previous, pan, options.size, cv::INTER_NEAREST,
                   cv::BORDER_REPLICATE);
    panned.previous_from_current = cv::Matx33d(1, 0, -8, 0, 1, 4, 0, 0, 1);
    const Silhouette s = ExtractSilhouette(panned);
    EXPECT_TRUE(s.camera_motion);
    EXPECT_GT(MaskIou(s.mask, expected.mask), 0.995) << scale;
  }
}

TEST(Silhouette, MotionTellsEqualColoursApart) {
  // The figure came from any side; what it has just left helps least when the model errs there.
  TestSceneOptions options;
  options.same_texture = true;
  Case c = MakeCase(options, 0.03);
  SegmentationOptions without;
  without.gamma_motion = 0;
  without.weight_still = 0;
  const double off = MaskIou(ExtractSilhouette(c.frame, without).mask, c.scene.truth);
  double on = 0;
  for (const cv::Point2d& step :
       {cv::Point2d(12, 0), cv::Point2d(-12, 0), cv::Point2d(0, 12), cv::Point2d(0, -12)}) {
    TestSceneOptions before = options;
    before.centre += step;
    before.seed = 2;
    c.frame.previous = MakeScene(before).picture;
    on += MaskIou(ExtractSilhouette(c.frame).mask, c.scene.truth) / 4;
  }
  EXPECT_GT(on, off);
}

// What the figure has just left has changed since the previous picture, but not until the next.
TEST(Silhouette, TheNextPictureTellsWhatTheActorHasLeft) {
  TestSceneOptions options;
  options.same_texture = true;
  Case c = MakeCase(options, 0.03);
  SegmentationOptions previous_only;
  previous_only.look_ahead = false;
  double one_side = 0, both_sides = 0;
  for (const cv::Point2d& step :
       {cv::Point2d(12, 0), cv::Point2d(-12, 0), cv::Point2d(0, 12), cv::Point2d(0, -12)}) {
    TestSceneOptions before = options, after = options;
    before.centre -= step;
    before.seed = 2;
    after.centre += step;
    after.seed = 3;
    c.frame.previous = MakeScene(before).picture;
    c.frame.next = MakeScene(after).picture;
    one_side += MaskIou(ExtractSilhouette(c.frame, previous_only).mask, c.scene.truth) / 4;
    both_sides += MaskIou(ExtractSilhouette(c.frame).mask, c.scene.truth) / 4;
  }
  EXPECT_GT(both_sides, one_side + 0.015);  // the greater change in place of the less: 0.009
}

TEST(Silhouette, OneNeighbourIsAsGoodAsTheOther) {
  Case c = MakeCase();
  const Silhouette behind = ExtractSilhouette(c.frame);
  std::swap(c.frame.previous, c.frame.next);
  const Silhouette ahead = ExtractSilhouette(c.frame);
  EXPECT_TRUE(ahead.motion_cue);
  EXPECT_EQ(cv::countNonZero(ahead.mask != behind.mask), 0);
  EXPECT_TRUE(behind.previous_from_current && !behind.next_from_current);
  EXPECT_TRUE(ahead.next_from_current && !ahead.previous_from_current);
}

// The first picture of a clip has no other, in the paper's preset as well.
TEST(Silhouette, TheNextPictureStandsInForTheFirstPicturesPrevious) {
  Case c = MakeCase();
  std::swap(c.frame.previous, c.frame.next);
  EXPECT_TRUE(ExtractSilhouette(c.frame, SegmentationOptions::Paper()).motion_cue);
  c.frame.previous = c.frame.next;
  const Silhouette both = ExtractSilhouette(c.frame, SegmentationOptions::Paper());
  EXPECT_TRUE(both.previous_from_current && !both.next_from_current);
}

TEST(Silhouette, PersonProbabilityDecidesWhereColoursCannot) {
  TestSceneOptions options;
  options.same_texture = true;
  Case c = MakeCase(options, 0.03);
  c.frame.previous = cv::Mat();
  const double without = MaskIou(ExtractSilhouette(c.frame).mask, c.scene.truth);
  c.frame.person_probability = c.scene.truth;
  const Silhouette bytes = ExtractSilhouette(c.frame);
  c.scene.truth.convertTo(c.frame.person_probability, CV_32F, 1.0 / 255);
  const Silhouette floats = ExtractSilhouette(c.frame);
  EXPECT_GT(MaskIou(bytes.mask, c.scene.truth), without);
  EXPECT_EQ(cv::countNonZero(bytes.mask != floats.mask), 0);
  c.frame.person_probability.setTo(std::numeric_limits<float>::quiet_NaN());
  EXPECT_NEAR(MaskIou(ExtractSilhouette(c.frame).mask, c.scene.truth), without, 1e-12);
}

TEST(Silhouette, MoreTrustInTheModelStaysCloserToIt) {
  TestSceneOptions scene;
  scene.same_texture = true;
  const Case c = MakeCase(scene, 0.03);
  double before = 0;
  for (const double weight : {0.0, 8.0, 40.0, 1000.0}) {
    SegmentationOptions options;
    options.weight_shape = weight;
    const double iou = ExtractSilhouette(c.frame, options).model_iou;
    EXPECT_GT(iou, before) << weight;
    before = iou;
  }
  EXPECT_GT(before, 0.95);
}

// A flap of cloth in the actor's colour that M knows nothing of, wider than the band.
TEST(Silhouette, WhatAnEarlierCutFoundBeyondTheBandStays) {
  Case c = MakeCase({}, 0);
  cv::Mat flap(c.scene.truth.size(), CV_8U, cv::Scalar(0));
  const std::vector<cv::Point> corners = {{125, 150}, {180, 190}, {125, 190}};
  cv::fillConvexPoly(flap, corners, 255);
  const cv::Scalar colour = cv::mean(c.scene.picture, c.scene.truth);
  c.frame.picture.setTo(colour, flap);
  const cv::Mat beyond = flap & ~c.scene.truth;
  const auto found = [&](const SegmentationOptions& options) {
    const Silhouette s = ExtractSilhouette(c.frame, options);
    ExpectDefined(s, c.frame);
    return cv::countNonZero(s.mask & beyond) / static_cast<double>(cv::countNonZero(beyond));
  };
  SegmentationOptions options = SegmentationOptions::AfterRefinement();
  const double without = found(options);
  EXPECT_LT(without, 0.6);
  c.frame.earlier = c.scene.truth | flap;
  EXPECT_GT(found(options), 0.95);
  options.keep_earlier = false;
  EXPECT_EQ(found(options), without);
  // It is not believed where the colours speak against it.
  cv::circle(c.frame.earlier, {40, 250}, 20, 255, cv::FILLED);
  const Silhouette s = ExtractSilhouette(c.frame, SegmentationOptions::AfterRefinement());
  EXPECT_EQ(s.mask.at<uint8_t>(250, 40), 0);
}

// A flap of M that is elsewhere in the picture, wider than what M's core is taken from.
TEST(Silhouette, PiecesThatAnEarlierCutDidNotHoldAreOpen) {
  Case c = MakeCase({}, 0);
  cv::Mat flap(c.scene.truth.size(), CV_8U, cv::Scalar(0));
  cv::rectangle(flap, cv::Rect(125, 140, 60, 50), 255, cv::FILLED);
  const cv::Mat beyond = flap & ~c.scene.truth;
  c.frame.model_mask = c.scene.truth | flap;
  const auto left = [&] {
    const Silhouette s = ExtractSilhouette(c.frame, SegmentationOptions::AfterRefinement());
    ExpectDefined(s, c.frame);
    return cv::countNonZero(s.mask & beyond) / static_cast<double>(cv::countNonZero(beyond));
  };
  EXPECT_GT(left(), 0.5);
  c.frame.earlier = c.scene.truth;
  EXPECT_LT(left(), 0.05);
  // The earlier cut is not believed where the colours speak against it.
  const cv::Rect body = cv::boundingRect(c.scene.truth);
  c.frame.earlier = c.scene.truth.clone();
  c.frame.earlier(cv::Rect(body.x, body.y + body.height / 3, body.width, 30)).setTo(0);
  const Silhouette s = ExtractSilhouette(c.frame, SegmentationOptions::AfterRefinement());
  EXPECT_GT(MaskIou(s.mask, c.scene.truth), 0.95);
}

// M and the first silhouette are the figure, and what is behind it is known.
Case MakeSecondCut() {
  Case c = MakeCase({}, 0);
  c.frame.previous = cv::Mat();
  c.frame.model_mask = c.scene.truth.clone();
  c.frame.earlier = c.frame.model_mask;
  TestSceneOptions empty;
  empty.centre = {-1000, -1000};
  empty.seed = 5;
  c.frame.background = {MakeScene(empty).picture,
                        cv::Mat(c.scene.truth.size(), CV_8U, cv::Scalar(4))};
  return c;
}

// Cloth far beyond the band, and background that M and the cut before cover: the plate shows both.
TEST(Silhouette, ThePlateOpensWhatTheBandDoesNotReach) {
  Case c = MakeSecondCut();
  FrameInput& frame = c.frame;
  const cv::Point tail[] = {{130, 160}, {215, 215}, {140, 200}};
  const cv::Rect coat(60, 200, 36, 36);  // beside the legs
  cv::Mat swung(frame.picture.size(), CV_8U, cv::Scalar(0)), bare = swung.clone();
  cv::fillConvexPoly(swung, tail, 3, 255);
  swung &= ~c.scene.truth;
  bare(coat) = 255;
  bare &= ~c.scene.truth;
  frame.picture.setTo(TestSceneOptions().colour, swung);
  frame.model_mask |= bare;  // the first silhouette's as well
  const Silhouette cut = ExtractSilhouette(frame, SegmentationOptions::AfterRefinement());
  ASSERT_EQ(cut.state, SilhouetteState::kCut);
  const auto share = [&](const cv::Mat& of) {
    return 1.0 * cv::countNonZero(cut.mask & of) / cv::countNonZero(of);
  };
  EXPECT_GT(share(swung), 0.9);
  EXPECT_LT(share(bare), 0.1);
  EXPECT_GT(share(c.scene.truth), 0.97);
}

// Who passes by differs from the plate too, but has other colours.
TEST(Silhouette, ThePlateTakesNoStrangersIn) {
  Case c = MakeSecondCut();
  FrameInput& frame = c.frame;
  cv::Mat stranger(frame.picture.size(), CV_8U, cv::Scalar(0));
  cv::circle(stranger, {170, 200}, 28, 255, cv::FILLED);
  stranger &= ~c.scene.truth;
  frame.picture.setTo(cv::Scalar(60, 200, 60), stranger);
  const Silhouette cut = ExtractSilhouette(frame, SegmentationOptions::AfterRefinement());
  EXPECT_LT(1.0 * cv::countNonZero(cut.mask & stranger) / cv::countNonZero(stranger), 0.1);
  EXPECT_GT(MaskIou(cut.mask, c.scene.truth), 0.97);
}

// Nor whom the plate shows in the actor's colours, somewhere else.
TEST(Silhouette, ThePlateTakesNoTwinsIn) {
  Case c = MakeSecondCut();
  FrameInput& frame = c.frame;
  cv::Mat twin(frame.picture.size(), CV_8U, cv::Scalar(0));
  twin(cv::Rect(196, 190, 26, 60)) = 255;
  ASSERT_EQ(cv::countNonZero(twin & c.scene.truth), 0);
  frame.picture.setTo(TestSceneOptions().colour, twin);
  const Silhouette cut = ExtractSilhouette(frame, SegmentationOptions::AfterRefinement());
  EXPECT_EQ(cv::countNonZero(cut.mask & twin), 0);
}

// The last pixels of a body, which the lamp does not reach: nearer to what is behind than to the
// rest of the body, and lost in the first cut.
TEST(Silhouette, ASecondCutLearnsTheShadedRim) {
  cv::Mat truth(300, 320, CV_8UC1, cv::Scalar(0));
  cv::ellipse(truth, {160, 150}, {45, 110}, 0, 0, 360, 255, cv::FILLED);
  cv::Mat lit;
  cv::erode(truth, lit, cv::Mat::ones(7, 7, CV_8U));
  const cv::Mat rim = truth & ~lit;
  FrameInput frame;
  frame.model_mask = truth;
  frame.earlier = lit;
  frame.picture = cv::Mat(truth.size(), CV_8UC3, cv::Scalar(70, 70, 70));
  frame.picture.setTo(cv::Scalar(60, 90, 200), lit);
  frame.picture.setTo(cv::Scalar(50, 50, 60), rim);
  cv::Mat noise(truth.size(), CV_16SC3);
  cv::RNG(3).fill(noise, cv::RNG::NORMAL, 0, 8);
  cv::add(frame.picture, noise, frame.picture, {}, CV_8UC3);
  const Silhouette cut = ExtractSilhouette(frame, SegmentationOptions::AfterRefinement());
  ASSERT_EQ(cut.state, SilhouetteState::kCut);
  EXPECT_GT(1.0 * cv::countNonZero(cut.mask & rim) / cv::countNonZero(rim), 0.9);
  EXPECT_GT(MaskIou(cut.mask, truth), 0.97);
}

// Legs that the fitted model has too close together, in colours that hardly tell them from what is
// behind: outlines as dear as in the first cut keep them closed.
TEST(Silhouette, AfterRefinementColoursOpenANarrowGap) {
  cv::Mat truth(300, 320, CV_8UC1, cv::Scalar(0));
  truth(cv::Rect(120, 60, 80, 180)).setTo(255);
  FrameInput frame;
  frame.model_mask = truth.clone();
  frame.model_mask(cv::Rect(159, 180, 2, 60)).setTo(0);
  const cv::Rect gap(157, 180, 6, 60);
  truth(gap).setTo(0);
  for (const uint64_t seed : {5, 6, 7}) {
    frame.picture = cv::Mat(truth.size(), CV_8UC3, cv::Scalar(110, 110, 110));
    frame.picture.setTo(cv::Scalar(124, 96, 124), truth);
    cv::Mat noise(truth.size(), CV_16SC3);
    cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, 8);
    cv::add(frame.picture, noise, frame.picture, {}, CV_8UC3);
    const auto opened = [&](const SegmentationOptions& options) {
      const cv::Mat mask = ExtractSilhouette(frame, options).mask;
      return 1 - cv::countNonZero(mask(gap)) / static_cast<double>(gap.area());
    };
    SegmentationOptions dear = SegmentationOptions::AfterRefinement();
    dear.gamma = SegmentationOptions().gamma;
    EXPECT_LT(opened(dear), 0.2) << seed;
    EXPECT_GT(opened(SegmentationOptions::AfterRefinement()), 0.9) << seed;
  }
}

// Where the picture shows that M is right, M's outline counts where the picture shows none: before a
// board of the actor's colour.
TEST(Silhouette, AModelMeasuredToBeGoodHoldsWhereColoursDoNot) {
  Case c = MakeCase({}, 0);
  const cv::Mat board(c.scene.truth.size(), CV_8U, cv::Scalar(0));
  board(cv::Rect(120, 110, 100, 60)).setTo(255);
  c.frame.picture = c.scene.picture.clone();
  c.frame.previous = cv::Mat();
  c.frame.picture.setTo(TestSceneOptions().colour, board & ~c.scene.truth);
  const auto iou = [&](double weight_measured) {
    SegmentationOptions options;
    options.weight_measured = weight_measured;
    return MaskIou(ExtractSilhouette(c.frame, options).mask, c.scene.truth);
  };
  EXPECT_LT(iou(0), 0.98);
  EXPECT_GT(iou(SegmentationOptions().weight_measured), 0.99);
}

TEST(Silhouette, PersonOfTheBackgroundsColourGivesTheModel) {
  const TestSceneOptions options;
  const cv::Mat model = WrongModel(options, 0);
  FrameInput frame;
  frame.picture = cv::Mat(options.size, CV_8UC3, cv::Scalar(90, 90, 90));
  frame.model_mask = model;
  const Silhouette plain = ExtractSilhouette(frame);
  ExpectDefined(plain, frame);
  EXPECT_EQ(plain.state, SilhouetteState::kAmbiguous);
  EXPECT_EQ(cv::countNonZero(plain.mask != model), 0);
  EXPECT_EQ(plain.model_iou, 1);
}

TEST(Silhouette, NoModelGivesNoMask) {
  Case c = MakeCase();
  c.frame.model_mask = cv::Mat(c.frame.picture.size(), CV_8U, cv::Scalar(0));
  const Silhouette s = ExtractSilhouette(c.frame);  // also: model wholly outside the picture
  ExpectDefined(s, c.frame);
  EXPECT_EQ(s.state, SilhouetteState::kNoModel);
  EXPECT_EQ(cv::countNonZero(s.mask), 0);
  EXPECT_TRUE(s.roi.empty());
}

TEST(Silhouette, ModelPartlyOutsideThePicture) {
  for (const cv::Point2d& centre :
       {cv::Point2d(0, 160), cv::Point2d(240, 160), cv::Point2d(120, 0), cv::Point2d(120, 320)}) {
    TestSceneOptions options;
    options.centre = centre;
    Case c = MakeCase(options);
    const Silhouette s = ExtractSilhouette(c.frame);
    ExpectDefined(s, c.frame);
    EXPECT_GT(MaskIou(s.mask, c.scene.truth), 0.94) << centre;
    // Telling it the whole actor's size is allowed, and any size at all is survived.
    for (const double size : {0.5, 100.0, 999999.0}) {
      c.frame.actor_size_px = size;
      ExpectDefined(ExtractSilhouette(c.frame), c.frame);
    }
  }
}

TEST(Silhouette, MaskThatTouchesAllBorders) {
  TestSceneOptions options;
  options.size = {160, 200};
  options.centre = {80, 100};
  options.height = 520;  // torso and limbs leave the picture on all sides
  const Case c = MakeCase(options, 0.01);
  ExpectDefined(ExtractSilhouette(c.frame), c.frame);

  FrameInput all = c.frame;
  all.model_mask = cv::Mat(options.size, CV_8U, cv::Scalar(255));
  const Silhouette full = ExtractSilhouette(all);
  ExpectDefined(full, all);
  EXPECT_EQ(full.state, SilhouetteState::kNoBackground);
  EXPECT_EQ(cv::countNonZero(full.mask == 0), 0);
}

TEST(Silhouette, GreyAndSixteenBitPictures) {
  const Case c = MakeCase();
  const double reference = MaskIou(ExtractSilhouette(c.frame).mask, c.scene.truth);
  for (const int kind : {0, 1, 2, 3}) {
    FrameInput frame = c.frame;
    const auto convert = [kind](const cv::Mat& bgr) {
      cv::Mat out = bgr;
      if (kind == 0) cv::cvtColor(bgr, out, cv::COLOR_BGR2GRAY);
      if (kind == 1) bgr.convertTo(out, CV_16U, 257);
      if (kind == 2) cv::cvtColor(bgr, out, cv::COLOR_BGR2BGRA);
      if (kind == 3) {
        cv::cvtColor(bgr, out, cv::COLOR_BGR2GRAY);
        out.convertTo(out, CV_16U, 257);
      }
      return out;
    };
    frame.picture = convert(frame.picture);
    frame.previous = convert(frame.previous);
    const Silhouette s = ExtractSilhouette(frame);
    ExpectDefined(s, frame);
    EXPECT_GT(MaskIou(s.mask, c.scene.truth), kind % 3 == 0 ? 0.9 : reference - 1e-9) << kind;
  }
}

TEST(Silhouette, FirstFrameAndSingleFrame) {
  Case c = MakeCase();
  c.frame.previous = cv::Mat();
  const Silhouette s = ExtractSilhouette(c.frame);
  EXPECT_FALSE(s.motion_cue);
  EXPECT_GT(MaskIou(s.mask, c.scene.truth), 0.96);
  c.frame.previous = c.frame.picture;  // a clip that stands still
  EXPECT_GT(MaskIou(ExtractSilhouette(c.frame).mask, c.scene.truth), 0.95);
}

TEST(Silhouette, SmallAndLargePictures) {
  for (const cv::Size size : {cv::Size(64, 64), cv::Size(3840, 2160), cv::Size(101, 77)}) {
    TestSceneOptions options;
    options.size = size;
    options.centre = {0.5 * size.width, 0.5 * size.height};
    options.height = 0.8 * size.height;
    const Case c = MakeCase(options);
    const Silhouette s = ExtractSilhouette(c.frame);
    ExpectDefined(s, c.frame);
    EXPECT_GT(MaskIou(s.mask, c.scene.truth), size.height < 100 ? 0.85 : 0.97) << size;
  }
}

TEST(Silhouette, PicturesOfAFewPixels) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(2, 1), cv::Size(3, 7), cv::Size(300, 1)}) {
    FrameInput frame;
    frame.picture = cv::Mat(size, CV_8UC3, cv::Scalar(1, 2, 3));
    frame.previous = frame.picture;
    frame.model_mask = cv::Mat(size, CV_8U, cv::Scalar(0));
    frame.model_mask.at<uint8_t>(0, 0) = 1;
    ExpectDefined(ExtractSilhouette(frame), frame);
    ExpectDefined(ExtractSilhouette(frame, SegmentationOptions::Paper()), frame);
  }
}

TEST(Silhouette, NoIslandsAndNoPinholes) {
  // Discs of the actor's colour beside the actor, and of the background's inside of it.
  TestSceneOptions options;
  Case c = MakeCase(options, 0);
  c.frame.previous = cv::Mat();
  cv::Mat inside, outside;
  cv::distanceTransform(c.scene.truth, inside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::distanceTransform(c.scene.truth == 0, outside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  for (int y = 10; y < options.size.height; y += 40) {
    for (int x = 10; x < options.size.width; ++x) {
      if (outside.at<float>(y, x) > 7.5 && outside.at<float>(y, x) < 8.5) {
        cv::circle(c.frame.picture, {x, y}, 3, options.colour, cv::FILLED);
      }
      if (inside.at<float>(y, x) > 5 && inside.at<float>(y, x) < 6) {
        cv::circle(c.frame.picture, {x, y}, 2, options.background, cv::FILLED);
      }
    }
  }
  const auto num_pieces = [](const cv::Mat& mask) {
    cv::Mat region;
    return cv::connectedComponents(mask, region) + cv::connectedComponents(mask == 0, region) - 2;
  };
  SegmentationOptions as_cut;
  as_cut.clean = false;
  as_cut.weight_shape = 0;
  SegmentationOptions cleaned = as_cut;
  cleaned.clean = true;
  EXPECT_GT(num_pieces(ExtractSilhouette(c.frame, as_cut).mask), num_pieces(c.scene.truth) + 4);
  const Silhouette s = ExtractSilhouette(c.frame, cleaned);
  EXPECT_EQ(num_pieces(s.mask), num_pieces(c.scene.truth));
  EXPECT_GT(MaskIou(s.mask, c.scene.truth), 0.96);
}

TEST(Silhouette, PaperPresetSolvesTheSameScene) {
  const Case c = MakeCase();
  const Silhouette s = ExtractSilhouette(c.frame, SegmentationOptions::Paper());
  ExpectDefined(s, c.frame);
  EXPECT_GT(MaskIou(s.mask, c.scene.truth), 0.95);
}

TEST(Silhouette, ExternalMasks) {
  cv::Mat grey(30, 40, CV_8U, cv::Scalar(100));
  grey(cv::Rect(5, 6, 7, 8)).setTo(200);
  cv::Mat colour;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  const cv::Mat labels = (grey > 127) / 255;  // 0 and 1
  for (const cv::Mat& mask : {grey, colour, labels}) {
    const Silhouette s = SilhouetteFromMask(mask, {40, 30});
    EXPECT_EQ(s.state, SilhouetteState::kExternal);
    EXPECT_EQ(s.roi, cv::Rect(5, 6, 7, 8));
    EXPECT_EQ(cv::countNonZero(s.mask == 255), 56);
  }
  EXPECT_EQ(cv::countNonZero(SilhouetteFromMask(cv::Mat::zeros(30, 40, CV_8U), {40, 30}).mask), 0);
  EXPECT_MPC_ERROR(SilhouetteFromMask(grey, {40, 31}), kMismatch, "40x30");
}

TEST(Silhouette, RefusesWhatDoesNotFit) {
  const Case c = MakeCase();
  FrameInput frame = c.frame;
  frame.picture = cv::Mat();
  EXPECT_MPC_ERROR(ExtractSilhouette(frame), kInvalidArgument, "picture is empty");
  frame = c.frame;
  frame.picture.convertTo(frame.picture, CV_32F);
  EXPECT_MPC_ERROR(ExtractSilhouette(frame), kUnsupported, "CV_32FC3");
  frame = c.frame;
  frame.previous = cv::Mat(10, 10, CV_8UC3);
  EXPECT_MPC_ERROR(ExtractSilhouette(frame), kMismatch, "10x10");
  frame = c.frame;
  frame.model_mask = cv::Mat();
  EXPECT_MPC_ERROR(ExtractSilhouette(frame), kInvalidArgument, "model mask");
  frame = c.frame;
  frame.earlier = cv::Mat::zeros(10, 10, CV_8U);
  EXPECT_MPC_ERROR(ExtractSilhouette(frame), kMismatch, "earlier silhouette");
  frame = c.frame;
  frame.person_probability = cv::Mat::zeros(10, 10, CV_32F);
  EXPECT_MPC_ERROR(ExtractSilhouette(frame), kMismatch, "person probability");
  frame = c.frame;
  frame.actor_size_px = std::numeric_limits<double>::infinity();
  EXPECT_MPC_ERROR(ExtractSilhouette(frame), kInvalidArgument, "actor size");
}

TEST(SegmentationOptions, NamesEveryFault) {
  EXPECT_NO_THROW(SegmentationOptions{}.Validate());
  EXPECT_NO_THROW(SegmentationOptions::Paper().Validate());
  EXPECT_NO_THROW(SegmentationOptions::AfterRefinement().Validate());
  SegmentationOptions options;
  options.erode = -1;
  options.gamma_motion = 26;
  options.num_rounds = 0;
  options.weight_shape = std::numeric_limits<double>::quiet_NaN();
  for (const char* name : {"erode", "gamma_motion", "num_rounds", "weight_shape"}) {
    EXPECT_MPC_ERROR(options.Validate(), kInvalidArgument, name);
  }
}

}  // namespace
}  // namespace mpc
