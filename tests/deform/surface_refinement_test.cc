#include "mpc/deform/surface_refinement.h"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgproc.hpp>

#include "deform/dressed_person.h"
#include "mpc/eval/metrics.h"
#include "mpc/seg/contour.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

double MeanError_mm(const Eigen::Matrix3Xf& a, const Eigen::Matrix3Xf& b) {
  return 1000 * (a - b).colwise().norm().mean();
}

class SurfaceRefinementTest : public ::testing::Test {
 protected:
  static const testing::DressedPerson& Person() {
    static const testing::DressedPerson person = testing::MakeDressedPerson();
    return person;
  }
  static const DeformationGraph& Graph() {
    static const DeformationGraph graph = BuildDeformationGraph(Person().character.mesh);
    return graph;
  }
  static SurfaceRefinement Refine(const cv::Mat& mask,
                                  const SurfaceRefinementOptions& options = {}) {
    const SurfaceRefiner refiner(Person().character, Graph(), options);
    CorrespondenceScratch scratch;
    return refiner.Refine(Person().camera, Person().posed, ExtractContour(mask), &scratch);
  }
  static double Iou(const Eigen::Matrix3Xf& vertices) {
    return MaskIou(testing::MaskOf(Person(), vertices), testing::MaskOf(Person(), Person().truth));
  }
};

TEST_F(SurfaceRefinementTest, FindsAKnownDeformation) {
  const SurfaceRefinement refined = Refine(testing::MaskOf(Person(), Person().truth));
  ASSERT_EQ(refined.state, RefinementState::kRefined);
  const double before = MeanError_mm(Person().posed, Person().truth);
  const double after = MeanError_mm(refined.vertices, Person().truth);
  EXPECT_LT(Iou(Person().posed), 0.968);
  EXPECT_GT(Iou(refined.vertices), 0.97);
  EXPECT_LT(after, 0.75 * before);
  EXPECT_GT(refined.support, 0.7);
  Eigen::Matrix3Xf warped;
  WarpVertices(Graph(), refined.field, Person().posed, &warped);
  EXPECT_EQ(warped, refined.vertices);
}

TEST_F(SurfaceRefinementTest, DepthPriorKeepsNodesFromDrifting) {
  const cv::Mat mask = testing::MaskOf(Person(), Person().truth);
  SurfaceRefinementOptions without;
  without.depth_drift_weight = 0;
  const SurfaceRefinement kept = Refine(mask), adrift = Refine(mask, without);
  const auto drift_mm = [](const SurfaceRefinement& refined) {
    return 1000 * (refined.vertices - Person().posed).row(2).cwiseAbs().maxCoeff();
  };
  EXPECT_LT(drift_mm(kept), 0.6 * drift_mm(adrift));
  EXPECT_LT(MeanError_mm(kept.vertices, Person().truth),
            MeanError_mm(adrift.vertices, Person().truth));
}

// Pieces of cloth would shift and turn at no cost in E_arap.
TEST_F(SurfaceRefinementTest, ARaggedOutlineMovesNothingMuch) {
  cv::Mat mask = testing::MaskOf(Person(), Person().posed);
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(mask, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::RNG random(1);
  for (const std::vector<cv::Point>& outline : outlines) {
    for (size_t i = 0; i < outline.size(); i += 30) {
      cv::circle(mask, outline[i], random.uniform(2, 9), random.uniform(0, 2) == 0 ? 255 : 0, -1);
    }
  }
  SurfaceRefinementOptions without;
  without.side_drift_share = 0;
  EXPECT_LT(MeanError_mm(Refine(mask).vertices, Person().posed),
            0.9 * MeanError_mm(Refine(mask, without).vertices, Person().posed));
}

// A skirt that swings by 17 degrees as a whole, which the prior holds back in part.
TEST_F(SurfaceRefinementTest, AWideSwingIsStillFollowed) {
  Eigen::Matrix3Xf swung = Person().posed;
  const Eigen::Index first = Person().first_of_skirt, count = swung.cols() - first;
  const Eigen::Vector3f waist =
      swung.rightCols(count).rowwise().mean() - Eigen::Vector3f(0, 0.2f, 0);
  const Eigen::AngleAxisf swing(0.3f, Eigen::Vector3f::UnitZ());
  swung.rightCols(count) =
      (swing.matrix() * (swung.rightCols(count).colwise() - waist)).colwise() + waist;
  const SurfaceRefinement refined = Refine(testing::MaskOf(Person(), swung));
  EXPECT_LT(MeanError_mm(refined.vertices, swung), 0.65 * MeanError_mm(Person().posed, swung));
  EXPECT_GT(
      MaskIou(testing::MaskOf(Person(), refined.vertices), testing::MaskOf(Person(), swung)),
      MaskIou(testing::MaskOf(Person(), Person().posed), testing::MaskOf(Person(), swung)) + 0.01);
}

TEST_F(SurfaceRefinementTest, AFittingSurfaceStays) {
  const SurfaceRefinement refined = Refine(testing::MaskOf(Person(), Person().posed));
  ASSERT_EQ(refined.state, RefinementState::kRefined);
  EXPECT_LT(MeanError_mm(refined.vertices, Person().posed), 1);
  EXPECT_GT(MaskIou(testing::MaskOf(Person(), refined.vertices),
                    testing::MaskOf(Person(), Person().posed)),
            0.99);
}

TEST_F(SurfaceRefinementTest, ClothInFlightIsFollowedAndNothingElse) {
  SurfaceRefinementOptions never;
  never.flight_arap_weight = 0;
  const cv::Mat fits = testing::MaskOf(Person(), Person().posed);
  EXPECT_EQ(Refine(fits).vertices, Refine(fits, never).vertices);
  const Eigen::Matrix3Xf flown = Person().posed + 3 * (Person().truth - Person().posed);
  const cv::Mat mask = testing::MaskOf(Person(), flown);
  const auto iou = [&](const SurfaceRefinement& refined) {
    return MaskIou(testing::MaskOf(Person(), refined.vertices), mask);
  };
  EXPECT_GT(iou(Refine(mask)), iou(Refine(mask, never)) + 0.01);
}

// Its tip is the nearest point of no vertex that faces the same way: only the silhouette tells of it.
TEST_F(SurfaceRefinementTest, ATailThatNoVertexFindsIsFollowed) {
  cv::Mat mask = testing::MaskOf(Person(), Person().posed);
  const cv::Mat model = mask.clone();
  const cv::Rect box = cv::boundingRect(mask);
  const int y = box.y + 6 * box.height / 10;
  int right = mask.cols - 1;
  while (mask.at<uint8_t>(y, right) == 0) --right;
  const std::vector<cv::Point> tail = {
      {right - 10, y - 120}, {right + 60, y + 40}, {right - 10, y + 40}};
  cv::fillConvexPoly(mask, tail, 255);
  const auto reached = [&](const SurfaceRefinement& refined) {
    const cv::Mat surface = testing::MaskOf(Person(), refined.vertices);
    return static_cast<double>(cv::countNonZero(surface & mask & ~model)) /
           cv::countNonZero(mask & ~model);
  };
  SurfaceRefinementOptions never;
  never.flight_arap_weight = 0;
  EXPECT_LT(reached(Refine(mask, never)), 0.3);
  EXPECT_GT(reached(Refine(mask)), 0.6);
}

TEST_F(SurfaceRefinementTest, WhatFliesFarIsFollowedLonger) {
  SurfaceRefinementOptions once;
  once.max_flight_rounds = 0;
  const Eigen::Matrix3Xf away = Person().truth - Person().posed;
  // Near enough after the round that all cloth in flight has.
  const cv::Mat near = testing::MaskOf(Person(), Person().posed + 2 * away);
  EXPECT_EQ(Refine(near).vertices, Refine(near, once).vertices);
  const cv::Mat far = testing::MaskOf(Person(), Person().posed + 14 * away);
  const auto iou = [&](const SurfaceRefinement& refined) {
    return MaskIou(testing::MaskOf(Person(), refined.vertices), far);
  };
  EXPECT_GT(iou(Refine(far)), iou(Refine(far, once)) + 0.01);
}

// Of a vertex on the outline more than of one in the middle of the chest, and none without a target.
TEST_F(SurfaceRefinementTest, EvidenceIsWhereTheOutlineIs) {
  const SurfaceRefinement refined = Refine(testing::MaskOf(Person(), Person().posed));
  CorrespondenceScratch scratch;
  const ModelBoundary outline =
      FindOutline(Person().camera, refined.vertices,
                  SurfaceTopology::FromMesh(Person().character.mesh), {}, &scratch);
  ASSERT_EQ(refined.evidence.size(), refined.vertices.cols());
  EXPECT_GT(refined.evidence(outline.vertices).mean(), 2 * refined.evidence.mean());
  EXPECT_GE(refined.evidence.minCoeff(), 0);
  const cv::Mat nobody(Person().camera.height, Person().camera.width, CV_8U, cv::Scalar(0));
  EXPECT_EQ(Refine(nobody).evidence.size(), 0);
}

// Rounds before it only guide the search and are solved roughly. Here it is the only one.
TEST_F(SurfaceRefinementTest, TheLastRoundIsSolvedToTheTolerance) {
  const cv::Mat mask =
      testing::MaskOf(Person(), Person().posed + 3 * (Person().truth - Person().posed));
  const auto energy = [&](double tolerance) {
    SurfaceRefinementOptions options;
    options.arap_weights = {0.2};
    options.max_flight_rounds = 0;
    options.relative_tolerance = tolerance;
    return Refine(mask, options).cost_after;
  };
  const double least = energy(1e-6), rough = energy(0.1);
  EXPECT_LT(energy(SurfaceRefinementOptions().relative_tolerance) - least, 0.2 * (rough - least));
}

TEST_F(SurfaceRefinementTest, WhatDoesNotFitTheRestPullsLess) {
  cv::Mat mask = testing::MaskOf(Person(), Person().posed);
  const cv::Rect box = cv::boundingRect(mask);
  const int y = box.y + box.height / 3;
  int right = mask.cols - 1;
  while (mask.at<uint8_t>(y, right) == 0) --right;
  cv::circle(mask, {right, y}, 45, 255, cv::FILLED);
  SurfaceRefinementOptions alike;
  alike.robust_deviations = 0;
  const double moved = MeanError_mm(Refine(mask).vertices, Person().posed);
  const double pulled = MeanError_mm(Refine(mask, alike).vertices, Person().posed);
  EXPECT_GT(pulled, 1);
  EXPECT_LT(moved, 0.8 * pulled);
}

TEST_F(SurfaceRefinementTest, WithoutEvidenceNothingMoves) {
  const auto expect_unchanged = [](const SurfaceRefinement& refined, RefinementState state) {
    EXPECT_EQ(refined.state, state);
    EXPECT_EQ(refined.vertices, Person().posed);
    EXPECT_EQ(refined.field.translations.cwiseAbs().maxCoeff(), 0);
    EXPECT_EQ(refined.num_steps, 0);
  };
  cv::Mat mask = cv::Mat::zeros(1920, 1080, CV_8UC1);
  expect_unchanged(Refine(mask), RefinementState::kNoSilhouette);
  mask.setTo(255);
  expect_unchanged(Refine(mask), RefinementState::kNoSilhouette);
  // Somebody else in the corner.
  mask.setTo(0);
  cv::circle(mask, {100, 100}, 60, 255, -1);
  expect_unchanged(Refine(mask), RefinementState::kNoMatch);
  // The actor behind the camera.
  const SurfaceRefiner refiner(Person().character, Graph());
  CorrespondenceScratch scratch;
  const SurfaceRefinement behind =
      refiner.Refine(Person().camera, -Person().posed, ExtractContour(mask), &scratch);
  EXPECT_EQ(behind.state, RefinementState::kNoModel);
  EXPECT_EQ(behind.vertices, -Person().posed);
}

TEST_F(SurfaceRefinementTest, APartWithoutSilhouetteStays) {
  // The lower third is cut off by something in front.
  cv::Mat mask = testing::MaskOf(Person(), Person().truth);
  mask.rowRange(1400, 1920).setTo(0);
  const SurfaceRefinement refined = Refine(mask);
  ASSERT_EQ(refined.state, RefinementState::kRefined);
  for (int v = 0; v < refined.vertices.cols(); ++v) {
    if (Person().posed(1, v) < 0.75f) continue;  // the shanks
    EXPECT_LT((refined.vertices.col(v) - Person().posed.col(v)).norm(), 0.02f) << v;
  }
}

TEST_F(SurfaceRefinementTest, BrokenMasksGiveFiniteSurfaces) {
  cv::RNG random(7);
  for (int round = 0; round < 4; ++round) {
    cv::Mat mask = testing::MaskOf(Person(), Person().truth);
    for (int hole = 0; hole < 30; ++hole) {
      const cv::Point at(random.uniform(0, 1080), random.uniform(0, 1920));
      cv::circle(mask, at, random.uniform(5, 120), random.uniform(0, 2) * 255, -1);
    }
    for (const SurfaceRefinementOptions& options :
         {SurfaceRefinementOptions(), SurfaceRefinementOptions::Paper()}) {
      const SurfaceRefinement refined = Refine(mask, options);
      ASSERT_TRUE(refined.vertices.allFinite());
      if (refined.state == RefinementState::kRefined) {
        EXPECT_TRUE(std::isfinite(refined.cost_after));
      }
      EXPECT_LT((refined.vertices - Person().posed).cwiseAbs().maxCoeff(), 1) << round;
    }
  }
}

TEST_F(SurfaceRefinementTest, TheSameWithAUsedScratch) {
  const SurfaceRefiner refiner(Person().character, Graph());
  CorrespondenceScratch fresh, used;
  const Contour2d truth = ExtractContour(testing::MaskOf(Person(), Person().truth));
  const Contour2d posed = ExtractContour(testing::MaskOf(Person(), Person().posed));
  refiner.Refine(Person().camera, Person().truth, posed, &used);
  EXPECT_EQ(refiner.Refine(Person().camera, Person().posed, truth, &fresh).vertices,
            refiner.Refine(Person().camera, Person().posed, truth, &used).vertices);
}

TEST_F(SurfaceRefinementTest, MisuseIsRefused) {
  SurfaceRefinementOptions options;
  options.arap_weights = {0.6, -1};
  options.depth_drift_weight = std::numeric_limits<double>::quiet_NaN();
  options.side_drift_share = -0.1;
  EXPECT_MPC_ERROR(
      SurfaceRefiner(Person().character, Graph(), options), kInvalidArgument,
      "arap_weights is -1, expected positive numbers; depth_drift_weight is nan, expected 0 "
      "or more; side_drift_share is -0.1");
  options = {};
  options.arap_weights.clear();
  EXPECT_MPC_ERROR(options.Validate(), kInvalidArgument, "at least 1");
  const TriangleMesh ball = testing::Ball({0, 0, 0}, 1);
  EXPECT_MPC_ERROR(SurfaceRefiner(Person().character, BuildDeformationGraph(ball)),
                   kInvalidArgument, "a graph of 4802 vertices");
  const SurfaceRefiner refiner(Person().character, Graph());
  CorrespondenceScratch scratch;
  EXPECT_MPC_ERROR(refiner.Refine(Person().camera, ball.positions, {}, &scratch), kInvalidArgument,
                   "4802 vertices");
}

}  // namespace
}  // namespace mpc
