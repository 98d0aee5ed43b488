#include "mpc/eval/metrics.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/core/units.h"

namespace mpc {
namespace {

class MetricsTest : public ::testing::Test {
 protected:
  Eigen::MatrixXd RandomJoints(int num_joints, int num_frames) {
    std::normal_distribution<double> normal(0, 0.5);
    return Eigen::MatrixXd::NullaryExpr(3 * num_joints, num_frames,
                                        [&] { return normal(random_); });
  }
  // s R x + t of every joint.
  static Eigen::MatrixXd Moved(const Eigen::MatrixXd& joints, double scale,
                               const Eigen::Matrix3d& rotation, const Eigen::Vector3d& t) {
    Eigen::MatrixXd moved = joints;
    for (int f = 0; f < joints.cols(); ++f) {
      for (int row = 0; row < joints.rows(); row += 3) {
        moved.col(f).segment<3>(row) = scale * rotation * joints.col(f).segment<3>(row) + t;
      }
    }
    return moved;
  }
  std::mt19937_64 random_{1};
  std::vector<JointId> joints_{ScoredJoints14().begin(), ScoredJoints14().end()};
  Eigen::MatrixXd truth_ = RandomJoints(14, 7);
};

TEST_F(MetricsTest, TruthAgainstItselfIsZero) {
  const JointErrors errors = CompareJoints(joints_, truth_, truth_);
  EXPECT_EQ(errors.absolute.mean_mm, 0);
  EXPECT_EQ(errors.root.mean_mm, 0);
  EXPECT_EQ(errors.scale.mean_mm, 0);
  EXPECT_EQ(errors.similarity.mean_mm, 0);
  EXPECT_EQ(errors.place.mean_mm, 0);
  EXPECT_EQ(AccelerationError(truth_, truth_, 30).mean_mm_per_frame2, 0);
  EXPECT_EQ(errors.num_missing, 0);
  EXPECT_EQ(errors.absolute.num_observations, 14 * 7);
  EXPECT_EQ(errors.similarity.num_frames, 7);
}

TEST_F(MetricsTest, ProjectedTruthIsExactlyOnItself) {
  const Camera camera = Camera::FromFov(640, 480, 1);
  Eigen::MatrixXd in_camera = truth_;
  for (Eigen::Index row = 2; row < in_camera.rows(); row += 3) in_camera.row(row).array() += 10;
  Detections2d detections;
  detections.joints = joints_;
  for (const auto& frame : in_camera.colwise()) {
    Eigen::Matrix2Xd pixels(2, 14);
    for (int j = 0; j < 14; ++j) {
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(camera, frame.segment<3>(3 * j), &pixel));
      pixels.col(j) = pixel;
    }
    detections.frames.push_back({pixels, Eigen::VectorXd::Ones(14)});
  }
  const ReprojectionError error = CompareReprojection(camera, joints_, in_camera, detections);
  EXPECT_EQ(error.mean_px, 0);
  EXPECT_EQ(error.num_observations, 14 * 7);
}

TEST_F(MetricsTest, OneWrongJointIsAFourteenthOfItsError) {
  Eigen::MatrixXd estimate = truth_;
  const int row = 3 * 2;  // neither hip
  ASSERT_TRUE(joints_[2] != JointId::kLeftHip && joints_[2] != JointId::kRightHip);
  for (int f = 0; f < 7; ++f) estimate.col(f).segment<3>(row) += Eigen::Vector3d(0.02, 0.03, 0.06);
  const JointErrors errors = CompareJoints(joints_, estimate, truth_);
  EXPECT_NEAR(errors.absolute.mean_mm, 70.0 / 14, 1e-9);
  EXPECT_NEAR(errors.root.mean_mm, 70.0 / 14, 1e-9);
  EXPECT_NEAR(errors.root.per_joint_mm[2], 70, 1e-9);
  EXPECT_EQ(errors.place.mean_mm, 0);
}

TEST_F(MetricsTest, TranslationIsSeenByAbsoluteOnly) {
  const Eigen::MatrixXd moved = Moved(truth_, 1, Eigen::Matrix3d::Identity(), {0.03, 0, 0.04});
  const JointErrors errors = CompareJoints(joints_, moved, truth_);
  EXPECT_NEAR(errors.absolute.mean_mm, 50, 1e-9);
  EXPECT_NEAR(errors.absolute.per_frame_mm.minCoeff(), 50, 1e-9);
  EXPECT_NEAR(errors.absolute.per_joint_mm.maxCoeff(), 50, 1e-9);
  EXPECT_NEAR(errors.root.mean_mm, 0, 1e-9);
}

TEST_F(MetricsTest, ScaleIsRemovedByNMpjpe) {
  const Eigen::MatrixXd moved = Moved(truth_, 1.2, Eigen::Matrix3d::Identity(), {1, 2, 3});
  const JointErrors errors = CompareJoints(joints_, moved, truth_);
  EXPECT_GT(errors.root.mean_mm, 50);
  EXPECT_NEAR(errors.scale.mean_mm, 0, 1e-9);
}

TEST_F(MetricsTest, SimilarityIsRemovedByPaMpjpe) {
  const Eigen::MatrixXd estimate = truth_ + 0.05 * RandomJoints(14, 7);
  const double before = CompareJoints(joints_, estimate, truth_).similarity.mean_mm;
  const Eigen::MatrixXd moved = Moved(estimate, 0.7, ExpSO3({0.4, -2, 1}), {1, 2, 3});
  const JointErrors errors = CompareJoints(joints_, moved, truth_);
  EXPECT_GT(before, 5);
  EXPECT_NEAR(errors.similarity.mean_mm, before, 1e-9);
  EXPECT_GT(errors.scale.mean_mm, 10 * before);
}

TEST_F(MetricsTest, ReflectionIsNotRemoved) {
  Eigen::MatrixXd mirrored = truth_;
  for (int row = 0; row < mirrored.rows(); row += 3) mirrored.row(row) *= -1;
  EXPECT_GT(CompareJoints(joints_, mirrored, truth_).similarity.mean_mm, 50);
}

TEST_F(MetricsTest, MissingJointsAreSkippedAndCounted) {
  Eigen::MatrixXd estimate = truth_;
  estimate.row(0).array() += 0.010;
  estimate(3 * 4 + 1, 2) = kNan;
  Eigen::MatrixXd truth = truth_;
  truth.col(5).setConstant(kNan);
  const JointErrors errors = CompareJoints(joints_, estimate, truth);
  EXPECT_EQ(errors.num_missing, 15);
  EXPECT_EQ(errors.absolute.num_frames, 6);
  EXPECT_EQ(errors.absolute.num_observations, 14 * 6 - 1);
  EXPECT_TRUE(std::isnan(errors.absolute.per_frame_mm[5]));
  EXPECT_NEAR(errors.absolute.mean_mm, 10.0 * 6 / (14 * 6 - 1), 1e-9);
  EXPECT_NEAR(errors.absolute.per_joint_mm[0], 10, 1e-9);
}

TEST_F(MetricsTest, NoRootMeansNoRootAlignedFrame) {
  Eigen::MatrixXd truth = truth_;
  truth.middleRows<3>(3 * 6).col(1).setConstant(kNan);  // the left hip
  const JointErrors errors = CompareJoints(joints_, truth_, truth);
  EXPECT_EQ(errors.root.num_frames, 6);
  EXPECT_EQ(errors.scale.num_frames, 6);
  EXPECT_EQ(errors.similarity.num_frames, 7);
}

TEST_F(MetricsTest, DegenerateFramesAreNotScored) {
  const Eigen::MatrixXd point = Eigen::MatrixXd::Constant(42, 7, 1.0);
  const JointErrors errors = CompareJoints(joints_, point, truth_);
  EXPECT_EQ(errors.similarity.num_frames, 0);
  EXPECT_TRUE(std::isnan(errors.similarity.mean_mm));
  EXPECT_EQ(errors.absolute.num_frames, 7);
}

TEST_F(MetricsTest, WrongSizesAreRefused) {
  EXPECT_THROW(CompareJoints(joints_, truth_, RandomJoints(14, 6)), Error);
  EXPECT_THROW(CompareJoints(joints_, RandomJoints(13, 7), RandomJoints(13, 7)), Error);
}

TEST_F(MetricsTest, FormatNamesSetAlignmentAndFrames) {
  const std::string text = FormatJointErrors(CompareJoints(joints_, truth_, truth_));
  EXPECT_NE(text.find("PA-MPJPE"), std::string::npos);
  EXPECT_NE(text.find("14 joints, aligned: similarity, 7 of 7 frames"), std::string::npos);
}

TEST_F(MetricsTest, SelectJointsReordersAndMarksAbsentOnes) {
  const std::vector<JointId> wanted = {JointId::kNose, JointId::kRightShoulder};
  const Eigen::MatrixXd selected = SelectJoints(truth_, joints_, wanted);
  EXPECT_TRUE(selected.topRows<3>().array().isNaN().all());
  EXPECT_EQ(selected.bottomRows<3>(), truth_.middleRows<3>(3));
}

TEST_F(MetricsTest, JitterOfAQuadraticIsItsSecondDifference) {
  Eigen::MatrixXd joints(3, 20);
  for (int f = 0; f < 20; ++f) joints.col(f) << 0.5 * 0.006 * f * f, 3 * f, 0.5 * 0.008 * f * f;
  const SecondDifference jitter = Jitter(joints, 30);
  EXPECT_NEAR(jitter.mean_mm_per_frame2, 10, 1e-8);
  EXPECT_NEAR(jitter.mean_mm_per_s2, 9000, 1e-5);
  EXPECT_EQ(jitter.num_observations, 18);
  joints(0, 10) = kNan;
  EXPECT_EQ(Jitter(joints, 30).num_observations, 15);
  EXPECT_TRUE(std::isnan(Jitter(joints.leftCols(2), 30).mean_mm_per_frame2));
}

TEST_F(MetricsTest, AccelerationErrorIgnoresConstantVelocityOffsets) {
  Eigen::MatrixXd estimate = truth_;
  for (int f = 0; f < 7; ++f) estimate.col(f).array() += 0.1 + 0.2 * f;
  EXPECT_NEAR(AccelerationError(estimate, truth_, 30).mean_mm_per_frame2, 0, 1e-9);
  EXPECT_GT(Jitter(truth_, 30).mean_mm_per_frame2, 100);
  // On top of the truth's own motion every joint accelerates by (6, 0, 8) mm per frame^2.
  for (int f = 0; f < 7; ++f) {
    for (int row = 0; row < estimate.rows(); row += 3) {
      estimate.col(f).segment<3>(row) += 0.5 * f * f * Eigen::Vector3d(0.006, 0, 0.008);
    }
  }
  EXPECT_NEAR(AccelerationError(estimate, truth_, 30).mean_mm_per_frame2, 10, 1e-9);
  EXPECT_NEAR(AccelerationError(estimate, truth_, 30).mean_mm_per_s2, 9000, 1e-6);
}

TEST_F(MetricsTest, BoneLengthDeviation) {
  const std::vector<JointId> joints = {JointId::kLeftElbow, JointId::kLeftWrist};
  const std::vector<JointPair> bones = {{JointId::kLeftElbow, JointId::kLeftWrist},
                                        {JointId::kLeftHip, JointId::kLeftKnee}};
  Eigen::MatrixXd trajectories = Eigen::MatrixXd::Zero(6, 4);
  trajectories.row(5).setConstant(0.25);
  EXPECT_EQ(CompareBoneLengths(joints, trajectories, bones).max_mm, 0);
  trajectories.row(5) << 0.29, 0.31, 0.29, 0.31;
  const BoneLengthDeviation deviation = CompareBoneLengths(joints, trajectories, bones);
  EXPECT_EQ(deviation.num_bones, 1);
  EXPECT_NEAR(deviation.mean_mm, 10, 1e-9);
  EXPECT_NEAR(deviation.max_mm, 10, 1e-9);
}

TEST_F(MetricsTest, ReprojectionCountsWhatItCannotScore) {
  Camera camera = Camera::FromFov(640, 480, 1);
  const std::vector<JointId> joints = {JointId::kNeck, JointId::kLeftHip, JointId::kNose};
  Eigen::MatrixXd positions(9, 2);
  positions.col(0) << 0.1, 0.2, 3, 0, 0, -1, 0, 0, 2;
  positions.col(1) << 0, 0, 3, 0.1, 0, 2, 0, 0, 2;
  Detections2d detections;
  detections.joints = {JointId::kLeftHip, JointId::kNeck};
  for (int f = 0; f < 2; ++f) {
    Eigen::Matrix2Xd pixels = Eigen::Matrix2Xd::Zero(2, 2);
    Eigen::Vector2d pixel;
    ASSERT_TRUE(Project(camera, positions.col(f).head<3>(), &pixel));
    pixels.col(1) = pixel + Eigen::Vector2d(3, 4);
    detections.frames.push_back({pixels, Eigen::Vector2d(f == 0 ? 1 : 0, 1)});
  }
  const ReprojectionError error = CompareReprojection(camera, joints, positions, detections);
  EXPECT_NEAR(error.mean_px, 5, 1e-9);
  EXPECT_EQ(error.num_observations, 2);
  EXPECT_EQ(error.num_missing, 4);
}

TEST_F(MetricsTest, IouOfAClip) {
  std::vector<double> iou(20, 0.9);
  iou[3] = 0.5;
  iou[17] = 0.3;
  const IouSummary all = SummarizeIou(iou);
  EXPECT_EQ(all.num_frames, 20);
  EXPECT_NEAR(all.mean, (18 * 0.9 + 0.8) / 20, 1e-12);
  EXPECT_NEAR(all.worst_decile, 0.4, 1e-12);
  iou[3] = std::numeric_limits<double>::quiet_NaN();  // 19 frames: two are the worst tenth
  EXPECT_NEAR(SummarizeIou(iou).worst_decile, 0.6, 1e-12);
  EXPECT_EQ(SummarizeIou(iou).num_frames, 19);
  const IouSummary one = SummarizeIou(std::vector<double>{0.7});
  EXPECT_EQ(one.mean, 0.7);
  EXPECT_EQ(one.worst_decile, 0.7);
  EXPECT_TRUE(std::isnan(SummarizeIou({}).mean));
  EXPECT_TRUE(std::isnan(SummarizeIou({}).worst_decile));
}

TEST_F(MetricsTest, MaskIou) {
  cv::Mat a = cv::Mat::zeros(10, 10, CV_8UC1);
  cv::Mat b = a.clone();
  EXPECT_EQ(MaskIou(a, b), 1);
  a.rowRange(0, 4) = 255;
  EXPECT_EQ(MaskIou(a, a), 1);
  EXPECT_EQ(MaskIou(a, b), 0);
  b.rowRange(2, 8) = 1;
  EXPECT_DOUBLE_EQ(MaskIou(a, b), 20.0 / 80);
  EXPECT_THROW(MaskIou(a, cv::Mat::zeros(10, 9, CV_8UC1)), Error);
}

TEST_F(MetricsTest, RootError) {
  std::vector<JointId> joints = joints_;
  Eigen::MatrixXd moved = truth_;
  for (int row = 0; row < moved.rows(); row += 3) moved.row(row).array() += row == 0 ? 1 : 0.03;
  // The middle of the hips moves by 30 mm, whatever a shoulder does.
  const JointErrors errors = CompareJoints(joints, moved, truth_);
  EXPECT_NEAR(errors.place.mean_mm, 30, 1e-9);
  EXPECT_EQ(errors.place.num_observations, 7);
  EXPECT_EQ(errors.place.each_mm.rows(), 1);
  EXPECT_DOUBLE_EQ(errors.root.each_mm.mean(), errors.root.mean_mm);
  EXPECT_EQ(CompareJoints(joints, truth_, truth_).place.mean_mm, 0);
}

TEST_F(MetricsTest, BoundaryFOfMovedSquares) {
  cv::Mat a = cv::Mat::zeros(60, 80, CV_8UC1);
  cv::Mat b = a.clone();
  EXPECT_EQ(BoundaryF(a, b), 1);  // no outlines at all
  a(cv::Rect(20, 20, 20, 20)) = 255;
  EXPECT_EQ(BoundaryF(a, b), 0);
  EXPECT_EQ(BoundaryF(a, a), 1);
  b(cv::Rect(22, 20, 20, 20)) = 1;  // moved by two pixels
  EXPECT_EQ(BoundaryF(a, b, 2), 1);
  // Of a's 76 pixels of outline, near b's within a pixel: columns 21 to 39 of the upper and of the
  // lower side, and of the right side the two pixels next to those.
  EXPECT_DOUBLE_EQ(BoundaryF(a, b, 1), (2 * 19 + 2) / 76.0);
  EXPECT_EQ(BoundaryF(a, b, 1), BoundaryF(b, a, 1));
}

TEST_F(MetricsTest, BoundaryFWeighsPrecisionAndRecall) {
  cv::Mat a = cv::Mat::zeros(100, 100, CV_8UC1);
  a(cv::Rect(10, 10, 11, 11)) = 255;  // outline of 40 pixels
  cv::Mat b = a.clone();
  b(cv::Rect(60, 60, 31, 31)) = 255;  // one of 120 more
  EXPECT_DOUBLE_EQ(BoundaryF(a, b, 1), 2 * 1 * 0.25 / 1.25);
  // Where a mask runs out of the picture there is no outline.
  cv::Mat half = cv::Mat::zeros(100, 100, CV_8UC1);
  half.colRange(0, 50) = 255;
  cv::Mat line = cv::Mat::zeros(100, 100, CV_8UC1);
  line.colRange(49, 50) = 255;
  EXPECT_EQ(BoundaryF(half, line, 1), 1);
  EXPECT_THROW(BoundaryF(a, cv::Mat::zeros(10, 9, CV_8UC1)), Error);
  EXPECT_THROW(BoundaryF(a, b, 0), Error);
}

}  // namespace
}  // namespace mpc
