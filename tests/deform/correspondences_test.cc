// Correspondences: the paper's search against its definition, and the rules that are ours.
#include "mpc/deform/correspondences.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <random>

#include "deform/posed_actor.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::Vector2d;
using Eigen::VectorXd;
using testing::Actor;

class CorrespondencesTest : public ::testing::Test {
 protected:
  Correspondences Find(const VectorXd& pose, const Contour2d& silhouette,
                       const CorrespondenceOptions& options = {}) {
    return FindCorrespondences(camera_, testing::Vertices(Actor(), pose), topology_, parts_,
                               IndexSilhouette(silhouette, camera_), options, &scratch_);
  }
  ModelBoundary Outline(const VectorXd& pose, double min_spacing_m) {
    return FindOutline(camera_, testing::Vertices(Actor(), pose), topology_,
                       {.min_spacing_m = min_spacing_m}, &scratch_);
  }
  int CountPart(const Correspondences& found, int part) const {
    return static_cast<int>(std::count_if(found.vertices.begin(), found.vertices.end(),
                                          [&](int v) { return parts_.part(v) == part; }));
  }
  // The vertex of a segment that lies farthest along a direction of the actor at bind.
  static int Extreme(int segment, const Eigen::Vector3f& direction) {
    int best = -1;
    for (int v = 0; v < Actor().mesh.positions.cols(); ++v) {
      if (Actor().segments(0, v) != segment) continue;
      if (best < 0 || direction.dot(Actor().mesh.positions.col(v)) >
                          direction.dot(Actor().mesh.positions.col(best))) {
        best = v;
      }
    }
    return best;
  }

  Camera camera_ = testing::Camera1080();
  SurfaceTopology topology_ = SurfaceTopology::FromMesh(Actor().mesh);
  BodyParts parts_{Actor()};
  CorrespondenceScratch scratch_;
  VectorXd truth_ = testing::MidWalk();
  Contour2d silhouette_ = testing::SilhouetteOf(camera_, Actor(), truth_);
};

TEST_F(CorrespondencesTest, TheModelsOwnSilhouetteIsWhereItsOutlineIs) {
  const Correspondences found = Find(truth_, silhouette_);
  EXPECT_GT(found.num_boundary, 300);
  EXPECT_GT(found.size(), 0.97 * found.num_boundary);
  const Eigen::Matrix3Xf vertices = testing::Vertices(Actor(), truth_);
  double sum = 0;
  for (int k = 0; k < found.size(); ++k) {
    const Vector2d pixel =
        testing::PixelOf(camera_, vertices.col(found.vertices[k]).cast<double>());
    sum += std::abs(found.normals.col(k).dot(pixel - found.targets.col(k)));
  }
  EXPECT_LT(sum / found.size(), 0.5);
}

TEST_F(CorrespondencesTest, DistancesAreInMetresAtTheVertex) {
  const Correspondences found = Find(truth_, silhouette_);
  const Eigen::Matrix3Xf vertices = testing::Vertices(Actor(), truth_);
  ASSERT_EQ(found.distances.size(), found.size());
  for (int k = 0; k < found.size(); ++k) {
    const Eigen::Vector3d at = vertices.col(found.vertices[k]).cast<double>();
    const double px =
        found.normals.col(k).dot(testing::PixelOf(camera_, at) - found.targets.col(k));
    EXPECT_NEAR(found.distances[k], px * at.z() / std::max(camera_.fx, camera_.fy), 1e-5);
  }
}

TEST_F(CorrespondencesTest, RobustScaleIsThatOfMost) {
  Correspondences found;
  EXPECT_EQ(RobustScale(found, 3), 0);
  // Normal with sigma 0.01, but for a fifth that is anywhere.
  std::mt19937 rng(3);
  std::normal_distribution<double> normal(0, 0.01);
  found.distances.resize(1000);
  for (double& distance : found.distances) distance = normal(rng);
  found.vertices.resize(1000);
  EXPECT_NEAR(RobustScale(found, 3), 0.03, 0.002);
  found.distances.head(200).setConstant(-0.5);
  EXPECT_NEAR(RobustScale(found, 3), 0.038, 0.006);
}

TEST_F(CorrespondencesTest, PaperTakesTheClosestPointWithASimilarNormal) {
  const CorrespondenceOptions options = CorrespondenceOptions::Paper();
  const VectorXd start = testing::Perturbed(truth_, 3);
  const Correspondences found = Find(start, silhouette_, options);
  const ModelBoundary outline = Outline(start, 0);
  ASSERT_EQ(found.num_boundary, static_cast<int>(outline.vertices.size()));
  ASSERT_EQ(found.vertices, outline.vertices);
  EXPECT_EQ(found.weights, VectorXd::Ones(found.size()));
  for (int k = 0; k < found.size(); k += 5) {
    int best = -1;
    for (int i = 0; i < silhouette_.points.cols(); ++i) {
      const bool similar =
          silhouette_.normals.col(i).dot(outline.normals.col(k)) >= std::cos(options.max_angle_rad);
      const auto distance = [&](int j) {
        return (silhouette_.points.col(j) - outline.pixels.col(k)).squaredNorm();
      };
      if (similar && (best < 0 || distance(i) < distance(best))) best = i;
    }
    ASSERT_GE(best, 0);
    EXPECT_EQ(Vector2d(found.targets.col(k)), Vector2d(silhouette_.points.col(best)));
    EXPECT_EQ(Vector2d(found.normals.col(k)), Vector2d(silhouette_.normals.col(best)));
  }
}

TEST_F(CorrespondencesTest, WhatTheOutlineDoesNotExplainIsAdded) {
  const Eigen::Matrix3Xf vertices = testing::Vertices(Actor(), truth_);
  const ModelBoundary outline = Outline(truth_, 0);
  const auto match = [&](const ContourIndex& silhouette, bool add) {
    const CorrespondenceOptions options;
    Correspondences found = MatchOutline(camera_, vertices, outline, parts_, silhouette, options);
    if (add) AddUnexplained(camera_, vertices, outline, parts_, silhouette, options, &found);
    return found;
  };
  const ContourIndex fits = IndexSilhouette(silhouette_, camera_);
  const Correspondences fitting = match(fits, true);
  EXPECT_LT(fitting.size(), 1.15 * match(fits, false).size());
  EXPECT_LT(fitting.distances.cwiseAbs().maxCoeff(), 0.03);

  // A tail of cloth, 20 cm to the right of the model's rightmost pixel in the middle of the picture.
  cv::Mat mask = testing::MaskOf(camera_, Actor(), truth_);
  const cv::Mat model = mask.clone();
  const cv::Rect box = cv::boundingRect(mask);
  const double px_per_m = camera_.fx / vertices.row(2).mean();
  const int y = box.y + box.height / 2;
  int x = mask.cols - 1;
  while (mask.at<uint8_t>(y, x) == 0) --x;
  const cv::Point tip(x + cvRound(0.2 * px_per_m), y + 20);
  cv::fillConvexPoly(mask, std::vector<cv::Point>{{x - 10, y - 40}, tip, {x - 10, y + 40}}, 255);
  const ContourIndex silhouette = IndexSilhouette(ExtractContour(mask), camera_);
  const Correspondences before = match(silhouette, false), found = match(silhouette, true);
  EXPECT_EQ(found.num_boundary, before.num_boundary);
  ASSERT_GT(found.size(), before.size() + 50);
  ASSERT_EQ(found.targets.cols(), found.size());
  double farthest_px = 0;
  for (int k = 0; k < found.size(); ++k) {
    const Vector2d target = found.targets.col(k), normal = found.normals.col(k);
    const Vector2d pixel = testing::PixelOf(
        camera_, vertices.col(found.vertices[static_cast<size_t>(k)]).cast<double>());
    const double z = vertices(2, found.vertices[static_cast<size_t>(k)]);
    EXPECT_NEAR(found.distances[k], normal.dot(pixel - target) * z / camera_.fx, 1e-4);
    if (k < before.size()) continue;
    if (std::abs(found.distances[k]) > 0.03) {
      EXPECT_EQ(model.at<uint8_t>(cvRound(target.y()), cvRound(target.x())), 0);
    }
    EXPECT_NEAR(found.weights[k],
                1.0 * found.num_boundary / static_cast<double>(silhouette.contour().points.cols()),
                1e-12);
    farthest_px = std::max(farthest_px, target.x() - x);
  }
  EXPECT_GT(farthest_px, 0.7 * (tip.x - x));
}

TEST_F(CorrespondencesTest, FarTargetsAreRefusedByTheirDistanceInMetres) {
  VectorXd aside = truth_;
  aside[0] += 0.10;
  CorrespondenceOptions options{.min_part_support = 0, .min_support = 0};
  options.max_distance_m = 0.02;
  const Eigen::Matrix3Xf vertices = testing::Vertices(Actor(), aside);
  const Correspondences found = Find(aside, silhouette_, options);
  EXPECT_GT(found.size(), 0);
  EXPECT_LT(found.size(), 0.7 * found.num_boundary);
  for (int k = 0; k < found.size(); ++k) {
    const Eigen::Vector3d x = vertices.col(found.vertices[k]).cast<double>();
    EXPECT_LE((testing::PixelOf(camera_, x) - found.targets.col(k)).norm(),
              0.02 * camera_.fx / x.z() + 1e-3);
  }
}

TEST_F(CorrespondencesTest, PartsOfTheBody) {
  const Eigen::Vector3f forward(0, 0, 1), left(1, 0, 0);
  const int toe = Extreme(kLeftFootSegment, forward), heel = Extreme(kLeftFootSegment, -forward);
  const int other_toe = Extreme(kRightFootSegment, forward);
  const int hand = Extreme(kLeftForearmSegment, left), hip = Extreme(kPelvisSegment, left);
  const int knee_up = Extreme(kLeftThighSegment, {0, -1, 0});
  const int knee_down = Extreme(kLeftShankSegment, {0, 1, 0});
  for (const auto& [a, b] : {std::pair(toe, heel), {toe, other_toe}, {hand, hip}}) {
    EXPECT_FALSE(parts_.Compatible(a, b)) << a << " " << b;
    EXPECT_FALSE(parts_.Compatible(b, a)) << a << " " << b;
  }
  EXPECT_TRUE(parts_.Compatible(toe, toe));
  EXPECT_TRUE(parts_.Compatible(knee_up, knee_down));
  EXPECT_TRUE(parts_.Compatible(knee_down, knee_up));
  EXPECT_MPC_ERROR(BodyParts(Actor(), 0), kInvalidArgument, "reach");
}

// The silhouette lacks the left toe, and what is nearest to it shows other parts.
TEST_F(CorrespondencesTest, AToeDoesNotMatchAHeelOrTheOtherFoot) {
  const Eigen::Matrix3Xf vertices = testing::Vertices(Actor(), truth_);
  const Eigen::Vector3d toe = vertices.col(Extreme(kLeftFootSegment, {0, 0, 1})).cast<double>();
  const double px_per_m = camera_.fx / toe.z();
  const Contour2d without = testing::Filtered(silhouette_, [&](const Vector2d& x) {
    return (x - testing::PixelOf(camera_, toe)).norm() > 0.12 * px_per_m;
  });
  const ModelBoundary outline = Outline(truth_, 0);
  // Targets at the outline of a part that the vertex must not match.
  const auto count_wrong = [&](bool match_parts) {
    CorrespondenceOptions options{.min_part_support = 0, .min_support = 0};
    options.max_distance_m = 1;
    options.match_parts = match_parts;
    const Correspondences found = Find(truth_, without, options);
    int wrong = 0;
    for (int k = 0; k < found.size(); ++k) {
      Eigen::Index shown;
      (outline.pixels.colwise() - found.targets.col(k)).colwise().norm().minCoeff(&shown);
      wrong += parts_.part(found.vertices[k]) == kLeftFootSegment &&
               !parts_.Compatible(found.vertices[k], outline.vertices[shown]);
    }
    return wrong;
  };
  EXPECT_GT(count_wrong(false), 0);
  EXPECT_EQ(count_wrong(true), 0);
}

TEST_F(CorrespondencesTest, APartWithoutSilhouetteIsLeftAlone) {
  KinematicState state;
  ForwardKinematics(Actor().skeleton, truth_, &state);
  const Vector2d elbow = testing::PixelOf(camera_, state.joints.col(5));
  const Vector2d wrist = testing::PixelOf(camera_, state.joints.col(7));
  const auto near_forearm = [&](const Vector2d& x) {
    const double t =
        std::clamp((x - elbow).dot(wrist - elbow) / (wrist - elbow).squaredNorm(), 0.0, 1.6);
    return (x - elbow - t * (wrist - elbow)).norm() < 45;
  };
  const Contour2d cut =
      testing::Filtered(silhouette_, [&](const Vector2d& x) { return !near_forearm(x); });
  EXPECT_GT(CountPart(Find(truth_, silhouette_), kRightForearmSegment), 5);
  const Correspondences found = Find(truth_, cut);
  EXPECT_EQ(CountPart(found, kRightForearmSegment), 0);
  EXPECT_GT(CountPart(found, kLeftForearmSegment), 5);
  EXPECT_EQ(found.num_boundary, Find(truth_, silhouette_).num_boundary);
}

TEST_F(CorrespondencesTest, ThePicturesBorderIsNoSilhouette) {
  VectorXd leaving = truth_;
  leaving[0] = -2.1;
  const cv::Mat mask = testing::MaskOf(camera_, Actor(), leaving);
  ASSERT_GT(cv::countNonZero(mask.col(0)), 50);
  // A contour that, unlike ExtractContour's, runs along the border.
  Contour2d contour = ExtractContour(mask);
  const Eigen::Index own = contour.points.cols();
  contour.points.conservativeResize(2, own + camera_.height);
  contour.normals.conservativeResize(2, own + camera_.height);
  for (int y = 0; y < camera_.height; ++y) {
    contour.points.col(own + y) = Vector2d(0, y);
    contour.normals.col(own + y) = Vector2d(-1, 0);
  }
  const Correspondences found = Find(leaving, contour);
  EXPECT_GT(found.size(), 50);
  EXPECT_GE(found.targets.row(0).minCoeff(), 2);
}

TEST_F(CorrespondencesTest, NothingMatchesNothing) {
  EXPECT_EQ(Find(truth_, {}).size(), 0);
  VectorXd outside = truth_;
  outside[0] = 20;
  EXPECT_EQ(Find(outside, silhouette_).size(), 0);
  VectorXd behind = truth_;
  behind[2] = -4;
  EXPECT_EQ(Find(behind, silhouette_).size(), 0);
}

TEST_F(CorrespondencesTest, AnotherPersonsSilhouetteDoesNotMatch) {
  VectorXd other = testing::MotionInCamera(MotionKind::kSquat, 2, 30, 0.7).col(30);
  other[0] = truth_[0] + 0.45;
  EXPECT_EQ(Find(truth_, testing::SilhouetteOf(camera_, Actor(), other)).size(), 0);
}

TEST_F(CorrespondencesTest, WeightsMakeUpForTheDensityOfTheMesh) {
  // Everything has a target.
  CorrespondenceOptions options = CorrespondenceOptions::Paper();
  options.max_angle_rad = 3.1;
  options.weigh_by_length = true;
  const Correspondences found = Find(truth_, silhouette_, options);
  ASSERT_EQ(found.size(), found.num_boundary);
  EXPECT_NEAR(found.weights.mean(), 1, 1e-12);
  EXPECT_GT(found.weights.minCoeff(), 0);
  // Per part, the sum of weights is in proportion to the length of its outline.
  const auto share = [&](const Correspondences& c, int part) {
    double sum = 0;
    for (int k = 0; k < c.size(); ++k) sum += parts_.part(c.vertices[k]) == part ? c.weights[k] : 0;
    return sum / c.num_boundary;
  };
  options.weigh_by_length = false;
  options.min_spacing_m = 0.02;
  const Correspondences thinned = Find(truth_, silhouette_, options);
  for (const int part : {kChestSegment, kLeftShankSegment, kRightThighSegment}) {
    EXPECT_NEAR(share(found, part), share(thinned, part), 0.25 * share(thinned, part)) << part;
  }
}

TEST_F(CorrespondencesTest, ThinningKeepsOneVertexPerLength) {
  const ModelBoundary all = Outline(truth_, 0), thin = Outline(truth_, 0.03);
  EXPECT_LT(thin.pixels.cols(), 7 * all.pixels.cols() / 10);
  EXPECT_TRUE(std::is_sorted(thin.vertices.begin(), thin.vertices.end()));
  const auto near = [&](const ModelBoundary& a, int i, const ModelBoundary& b, int k, double px) {
    return (a.pixels.col(i) - b.pixels.col(k)).norm() < px &&
           a.normals.col(i).dot(b.normals.col(k)) > 0;
  };
  const double px = 0.03 * camera_.fx / 4;
  for (int i = 0; i < thin.pixels.cols(); ++i) {
    for (int k = 0; k < i; ++k) EXPECT_FALSE(near(thin, i, thin, k, 0.9 * px));
  }
  for (int i = 0; i < all.pixels.cols(); ++i) {
    bool covered = false;
    for (int k = 0; k < thin.pixels.cols(); ++k) covered |= near(all, i, thin, k, 1.1 * px);
    EXPECT_TRUE(covered) << i;
  }
}

TEST_F(CorrespondencesTest, BadInputIsRefused) {
  EXPECT_MPC_ERROR(Find(truth_, silhouette_, {.max_distance_m = 0, .max_angle_rad = 4}),
                   kInvalidArgument, "max_distance_m is 0, expected a positive number; max_angle");
  EXPECT_MPC_ERROR(Find(truth_, silhouette_, {.min_part_support = 2, .min_support = -1}),
                   kInvalidArgument, "min_support");
  EXPECT_MPC_ERROR(Find(truth_, silhouette_, {.min_spacing_m = -1}), kInvalidArgument, "spacing");
  Contour2d broken = silhouette_;
  broken.points(0, 7) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_MPC_ERROR(IndexSilhouette(broken, camera_), kInvalidArgument, "finite");
  broken = silhouette_;
  broken.normals.conservativeResize(2, 5);
  EXPECT_MPC_ERROR(IndexSilhouette(broken, camera_), kInvalidArgument, "normals");
}

}  // namespace
}  // namespace mpc
