// Pose refinement: towards the truth where there is a silhouette, nothing where there is none.
#include "mpc/deform/pose_refinement.h"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgproc.hpp>

#include "deform/posed_actor.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::VectorXd;
using testing::Actor;

class PoseRefinementTest : public ::testing::Test {
 protected:
  PoseRefinement Refine(const VectorXd& start, const Contour2d& silhouette,
                        const PoseRefinementOptions& options = {}) {
    return PoseRefiner(Actor(), options).Refine(camera_, start, silhouette, &scratch_);
  }
  Contour2d Silhouette(const VectorXd& pose) {
    return testing::SilhouetteOf(camera_, Actor(), pose);
  }
  void ExpectRefused(const VectorXd& start, const Contour2d& silhouette, RefinementState state) {
    const PoseRefinement result = Refine(start, silhouette);
    EXPECT_STREQ(RefinementStateName(result.state), RefinementStateName(state));
    EXPECT_EQ(result.pose, start);
  }

  Camera camera_ = testing::Camera1080();
  CorrespondenceScratch scratch_;
  VectorXd truth_ = testing::MidWalk();
};

// Ten starts each of three postures, off by 5 degrees per angle and 2 cm per axis: as the paper has
// it and as ours.
TEST_F(PoseRefinementTest, OverlapRisesAndJointsComeNearer) {
  const VectorXd squat = testing::MotionInCamera(MotionKind::kSquat, 2, 30, 0.5).col(20);
  const VectorXd reach = testing::MotionInCamera(MotionKind::kReach, 2, 30, -0.4).col(25);
  for (const bool paper : {false, true}) {
    double iou_before = 0, iou_after = 0, mm_before = 0, mm_after = 0;
    for (const VectorXd& truth : {truth_, squat, reach}) {
      const Contour2d silhouette = Silhouette(truth);
      for (unsigned seed = 0; seed < 10; ++seed) {
        const VectorXd start = testing::Perturbed(truth, seed);
        const PoseRefinement result = Refine(
            start, silhouette, paper ? PoseRefinementOptions::Paper() : PoseRefinementOptions());
        ASSERT_EQ(result.state, RefinementState::kRefined);
        EXPECT_GT(result.support, 0.6);
        EXPECT_LT(result.cost_after, result.cost_before);
        const double before = testing::Iou(camera_, start, truth);
        const double after = testing::Iou(camera_, result.pose, truth);
        EXPECT_GT(after, before) << "seed " << seed;
        iou_before += before / 30, iou_after += after / 30;
        mm_before += testing::JointErrorMm(start, truth) / 30;
        mm_after += testing::JointErrorMm(result.pose, truth) / 30;
      }
    }
    EXPECT_LT(iou_before, 0.85);
    EXPECT_GT(iou_after, iou_before + 0.08);
    EXPECT_LT(mm_after, 0.95 * mm_before);
  }
}

// The outline is larger or smaller than it should be; the paper holds the depth in millimetres.
TEST_F(PoseRefinementTest, TheOutlineTellsTheDepth) {
  const Contour2d silhouette = Silhouette(truth_);
  const Eigen::Vector3d ray = truth_.head<3>().normalized();
  for (const double off : {-0.08, 0.08}) {
    VectorXd start = truth_;
    start.head<3>() += off * ray;
    const auto left = [&](const PoseRefinementOptions& options) {
      return std::abs(
          ray.dot(Refine(start, silhouette, options).pose.head<3>() - truth_.head<3>()));
    };
    EXPECT_LT(left({}), 0.02) << off;
    EXPECT_GT(left(PoseRefinementOptions::Paper()), 0.06) << off;
  }
}

TEST_F(PoseRefinementTest, TheTruthStays) {
  const PoseRefinement result = Refine(truth_, Silhouette(truth_));
  EXPECT_EQ(result.state, RefinementState::kRefined);
  EXPECT_GT(result.support, 0.95);
  EXPECT_LT(testing::JointErrorMm(result.pose, truth_), 1.5);
}

// Between hip and knee the silhouette is wider, as by a coat.
TEST_F(PoseRefinementTest, WhatDoesNotFitTheRestDoesNotPull) {
  cv::Mat mask = testing::MaskOf(camera_, Actor(), truth_);
  const cv::Rect box = cv::boundingRect(mask);
  cv::Mat wide;
  cv::dilate(mask, wide, cv::Mat::ones(1, 31, CV_8U), {0, 0});  // to one side
  const cv::Range rows(box.y + box.height / 2, box.y + 3 * box.height / 4);
  wide.rowRange(rows).copyTo(mask.rowRange(rows));
  const Contour2d silhouette = ExtractContour(mask);
  PoseRefinementOptions fixed;
  fixed.robust_deviations = 1e9;
  const double error = testing::JointErrorMm(Refine(truth_, silhouette).pose, truth_);
  const double pulled = testing::JointErrorMm(Refine(truth_, silhouette, fixed).pose, truth_);
  EXPECT_GT(pulled, 1);
  EXPECT_LT(error, 0.6 * pulled);
}

// Far away and near, at half the resolution: the same to a millimetre or so.
TEST_F(PoseRefinementTest, DoesNotDependOnTheResolution) {
  const VectorXd start = testing::Perturbed(truth_, 5);
  const VectorXd full = Refine(start, Silhouette(truth_)).pose;
  camera_ = camera_.ScaledTo(960, 540);
  const VectorXd half = Refine(start, Silhouette(truth_)).pose;
  EXPECT_LT(testing::JointErrorMm(full, half), 0.2 * testing::JointErrorMm(full, start));
}

TEST_F(PoseRefinementTest, IsRepeatable) {
  const Contour2d silhouette = Silhouette(truth_);
  const VectorXd start = testing::Perturbed(truth_, 6);
  const VectorXd first = Refine(start, silhouette).pose;
  Refine(testing::Perturbed(truth_, 7), silhouette);  // leaves its traces in the scratch
  EXPECT_EQ(Refine(start, silhouette).pose, first);
}

TEST_F(PoseRefinementTest, StaysWithinTheBounds) {
  const Skeleton& skeleton = Actor().skeleton;
  VectorXd start = testing::Perturbed(truth_, 8);
  for (int n = 6; n < start.size(); n += 3) start[n] = skeleton.LowerBounds()[n];
  const VectorXd pose = Refine(start, Silhouette(truth_)).pose;
  EXPECT_TRUE((pose.array() >= skeleton.LowerBounds().array()).all());
  EXPECT_TRUE((pose.array() <= skeleton.UpperBounds().array()).all());
}

TEST_F(PoseRefinementTest, WithoutSilhouetteNothingChanges) {
  ExpectRefused(truth_, {}, RefinementState::kNoSilhouette);
  ExpectRefused(truth_, ExtractContour(cv::Mat::zeros(1080, 1920, CV_8UC1)),
                RefinementState::kNoSilhouette);
  ExpectRefused(truth_, ExtractContour(cv::Mat(1080, 1920, CV_8UC1, cv::Scalar(255))),
                RefinementState::kNoSilhouette);
}

TEST_F(PoseRefinementTest, OutsideThePictureNothingChanges) {
  VectorXd outside = truth_;
  outside[0] = 20;
  ExpectRefused(outside, Silhouette(truth_), RefinementState::kNoModel);
  VectorXd behind = truth_;
  behind[2] = -4;
  ExpectRefused(behind, Silhouette(truth_), RefinementState::kNoModel);
}

TEST_F(PoseRefinementTest, AnotherPersonsMaskChangesNothing) {
  VectorXd other = testing::MotionInCamera(MotionKind::kSquat, 2, 30, 0.7).col(30);
  other[0] = truth_[0] + 0.45;
  ExpectRefused(truth_, Silhouette(other), RefinementState::kNoMatch);
  other[0] = truth_[0] + 1.2;
  ExpectRefused(truth_, Silhouette(other), RefinementState::kNoMatch);
}

// Half in the picture: what is seen gets better, and nothing is dragged to the picture's border.
TEST_F(PoseRefinementTest, APersonLeavingThePictureIsStillRefined) {
  VectorXd leaving = truth_;
  leaving[0] = -2.15;
  const Contour2d silhouette = Silhouette(leaving);
  double before = 0, after = 0, mm_before = 0, mm_after = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    const VectorXd start = testing::Perturbed(leaving, seed);
    const PoseRefinement result = Refine(start, silhouette);
    ASSERT_EQ(result.state, RefinementState::kRefined);
    before += testing::Iou(camera_, start, leaving),
        after += testing::Iou(camera_, result.pose, leaving);
    mm_before += testing::JointErrorMm(start, leaving);
    mm_after += testing::JointErrorMm(result.pose, leaving);
  }
  EXPECT_GT(after, before);
  EXPECT_LT(mm_after, mm_before);
}

// A wall before the legs cuts the silhouette off along a straight line.
TEST_F(PoseRefinementTest, WhatAnOccluderHidesStaysNearTheBatch) {
  cv::Mat mask = testing::MaskOf(camera_, Actor(), truth_);
  mask.rowRange(700, camera_.height) = 0;
  double mm_before = 0, mm_after = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    const VectorXd start = testing::Perturbed(truth_, seed);
    const PoseRefinement result = Refine(start, ExtractContour(mask));
    ASSERT_EQ(result.state, RefinementState::kRefined);
    mm_before += testing::JointErrorMm(start, truth_);
    mm_after += testing::JointErrorMm(result.pose, truth_);
  }
  EXPECT_LT(mm_after, mm_before);
}

// Holes, a stray vertex, degenerate triangles, a second component that follows the pelvis.
TEST_F(PoseRefinementTest, BrokenMeshesAreRefinedToo) {
  Character broken = Actor();
  Triangles& triangles = broken.mesh.triangles;
  std::vector<Eigen::Index> kept;
  for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
    if (t % 50 != 0) kept.push_back(t);
  }
  const Triangles with_holes = triangles(Eigen::all, kept);
  const int num_vertices = static_cast<int>(broken.mesh.positions.cols());
  triangles.resize(3, with_holes.cols() + 6);
  triangles.leftCols(with_holes.cols()) = with_holes;
  // Degenerate: one vertex three times, one twice; then a tetrahedron before the belly.
  triangles.rightCols<6>() << 7, 7, 1, 1, 1, 2,  //
      7, 7, 2, 4, 3, 3,                          //
      7, 9, 3, 2, 4, 4;
  triangles.rightCols<4>().array() += num_vertices;
  const auto append = [&](const Eigen::Vector3f& x) {
    const Eigen::Index v = broken.mesh.positions.cols();
    broken.mesh.positions.conservativeResize(3, v + 1);
    broken.mesh.positions.col(v) = x;
    broken.segments.conservativeResize(Eigen::NoChange, v + 1);
    broken.weights.conservativeResize(Eigen::NoChange, v + 1);
    broken.segments.col(v).setZero();
    broken.weights.col(v) = Eigen::VectorXf::Unit(broken.weights.rows(), 0);
  };
  append({0, 50, 0});  // the stray one
  const Eigen::Vector3f belly(0, 1, 0.3f);
  append(belly);
  append(belly + Eigen::Vector3f(0.1f, 0, 0));
  append(belly + Eigen::Vector3f(0, 0.1f, 0));
  append(belly + Eigen::Vector3f(0, 0, 0.1f));

  const Contour2d silhouette = Silhouette(truth_);
  const PoseRefiner refiner(broken);
  for (unsigned seed = 0; seed < 5; ++seed) {
    const VectorXd start = testing::Perturbed(truth_, seed);
    const PoseRefinement result = refiner.Refine(camera_, start, silhouette, &scratch_);
    ASSERT_EQ(result.state, RefinementState::kRefined);
    EXPECT_GT(testing::Iou(camera_, result.pose, truth_), testing::Iou(camera_, start, truth_));
  }
}

TEST_F(PoseRefinementTest, AMeshWithoutTrianglesHasNoOutline) {
  Character empty = Actor();
  empty.mesh.triangles.resize(3, 0);
  const PoseRefinement result =
      PoseRefiner(empty).Refine(camera_, truth_, Silhouette(truth_), &scratch_);
  EXPECT_EQ(result.state, RefinementState::kNoModel);
  EXPECT_EQ(result.pose, truth_);
}

TEST_F(PoseRefinementTest, BadInputIsRefused) {
  PoseRefinementOptions options;
  options.num_iterations = 0;
  options.weight_stab = -1;
  options.robust_m = -1;
  options.correspondences = {};
  EXPECT_MPC_ERROR(PoseRefiner(Actor(), options), kInvalidArgument,
                   "num_iterations is 0, expected at least 1; weight_stab is -1");
  options = {};
  options.depth_deviation = -1;
  EXPECT_MPC_ERROR(PoseRefiner(Actor(), options), kInvalidArgument, "depth_deviation is -1");
  options = {};
  options.correspondences.max_distance_m = -1;
  EXPECT_MPC_ERROR(PoseRefiner(Actor(), options), kInvalidArgument, "max_distance_m");
  PoseRefinementOptions::Paper().Validate();
  const Contour2d silhouette = Silhouette(truth_);
  EXPECT_MPC_ERROR(Refine(truth_.head(20), silhouette), kInvalidArgument, "dofs");
  VectorXd broken = truth_;
  broken[9] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_MPC_ERROR(Refine(broken, silhouette), kInvalidArgument, "finite");
}

}  // namespace
}  // namespace mpc
