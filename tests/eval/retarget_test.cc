#include "mpc/eval/retarget.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/eval/metrics.h"
#include "mpc/eval/motions.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

using enum JointId;

// The 16 joints of a motion of our own skeleton as somebody else's clip, in centimetres.
SourceMotion AsSource(const Skeleton& skeleton, const Eigen::MatrixXd& poses, double unit) {
  struct Link {
    const char* name;
    int parent;
    JointId joint;
  };
  const std::vector<Link> links = {
      {"Hips", -1, kPelvis},           {"Neck", 0, kNeck},
      {"Head", 1, kHeadTop},           {"LeftArm", 0, kLeftShoulder},
      {"LeftForeArm", 3, kLeftElbow},  {"LeftHand", 4, kLeftWrist},
      {"RightArm", 0, kRightShoulder}, {"RightForeArm", 6, kRightElbow},
      {"RightHand", 7, kRightWrist},   {"LeftUpLeg", 0, kLeftHip},
      {"LeftLeg", 9, kLeftKnee},       {"LeftFoot", 10, kLeftAnkle},
      {"LeftToe", 11, kLeftToe},       {"RightUpLeg", 0, kRightHip},
      {"RightLeg", 13, kRightKnee},    {"RightFoot", 14, kRightAnkle},
      {"RightToe", 15, kRightToe},
  };
  SourceMotion source;
  source.fps = 30;
  const Eigen::MatrixXd joints = JointTrajectories(skeleton, poses);
  for (const Link& link : links) {
    source.names.push_back(link.name);
    source.parents.push_back(link.parent);
  }
  for (int f = 0; f < poses.cols(); ++f) {
    Eigen::Matrix3Xd positions(3, static_cast<int>(links.size()));
    for (size_t i = 0; i < links.size(); ++i) {
      const int j = skeleton.FindJointIndex(links[i].joint);
      positions.col(static_cast<int>(i)) = unit * joints.col(f).segment<3>(3 * j);
    }
    source.joint_positions.push_back(positions);
  }
  return source;
}

class RetargetTest : public ::testing::TestWithParam<MotionKind> {
 protected:
  Skeleton skeleton_ = DefaultSkeleton();
};

TEST_P(RetargetTest, ReproducesOurOwnMotion) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, GetParam(), 2, 30);
  RetargetSummary summary;
  const Eigen::MatrixXd found = Retarget(skeleton_, AsSource(skeleton_, poses, 100), &summary);
  ASSERT_EQ(found.rows(), poses.rows());
  ASSERT_EQ(found.cols(), poses.cols());
  EXPECT_NEAR(summary.scale, 0.01, 1e-9);
  EXPECT_LT(summary.mean_direction_error_rad, 0.03);

  std::vector<JointId> joints;
  for (const SkeletonJoint& joint : skeleton_.joints) joints.push_back(joint.id);
  const std::vector<JointId> scored(joints.begin(), joints.begin() + kNumPaperJoints);
  const Eigen::MatrixXd truth = SelectJoints(JointTrajectories(skeleton_, poses), joints, scored);
  const Eigen::MatrixXd result = SelectJoints(JointTrajectories(skeleton_, found), joints, scored);
  const JointErrors errors = CompareJoints(scored, result, truth);
  EXPECT_LT(errors.root.mean_mm, 20);
  EXPECT_LT(errors.absolute.mean_mm, 40);
  EXPECT_LT(AccelerationError(result, truth, 30).mean_mm_per_frame2, 5);
}

TEST_P(RetargetTest, StaysInsideTheBounds) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, GetParam(), 2, 30);
  const Skeleton small = DefaultSkeleton(1.2);
  const Eigen::MatrixXd found = Retarget(small, AsSource(skeleton_, poses, 1));
  for (int f = 0; f < found.cols(); ++f) {
    EXPECT_TRUE((found.col(f).array() >= small.LowerBounds().array()).all());
    EXPECT_TRUE((found.col(f).array() <= small.UpperBounds().array()).all());
  }
}

INSTANTIATE_TEST_SUITE_P(All, RetargetTest, ::testing::ValuesIn(kAllMotions),
                         [](const auto& kind) { return std::string(MotionName(kind.param)); });

TEST_F(RetargetTest, TheUnitOfTheSourceDoesNotMatter) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kWalk, 0.5, 30);
  const Eigen::MatrixXd a = Retarget(skeleton_, AsSource(skeleton_, poses, 1));
  const Eigen::MatrixXd b = Retarget(skeleton_, AsSource(skeleton_, poses, 39.37));
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-6);
}

TEST_F(RetargetTest, AnyFacingAtTheStart) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kReach, 0.2, 30);
  for (int i = 0; i < 8; ++i) {
    const Eigen::MatrixXd turned = TransformPoses(ExpSO3({0, 2 * std::numbers::pi * i / 8, 0}),
                                                  Eigen::Vector3d::Zero(), poses);
    RetargetSummary summary;
    Retarget(skeleton_, AsSource(skeleton_, turned, 1), &summary);
    EXPECT_LT(summary.mean_direction_error_rad, 0.03);
  }
}

TEST_F(RetargetTest, StandsOnTheFloorWhereverTheSourceStands) {
  const Eigen::MatrixXd poses = MakeMotion(skeleton_, MotionKind::kSquat, 2, 30);
  SourceMotion source = AsSource(skeleton_, poses, 1);
  for (Eigen::Matrix3Xd& positions : source.joint_positions) positions.row(1).array() += 7.5;
  const Eigen::MatrixXd joints =
      JointTrajectories(skeleton_, Retarget(skeleton_, source)).topRows<48>();
  for (int f = 0; f < joints.cols(); ++f) {
    EXPECT_NEAR(joints.col(f).reshaped(3, 16).row(1).minCoeff(), 0, 0.03);
  }
}

TEST_F(RetargetTest, FlatFeetStayFlatWhateverTheShapeOfTheSourcesFeet) {
  SourceMotion source = AsSource(skeleton_, MakeMotion(skeleton_, MotionKind::kSquat, 2, 30), 1);
  for (Eigen::Matrix3Xd& positions : source.joint_positions) {
    positions(1, 12) -= 0.08;  // toe tips far below the ankles
    positions(1, 16) -= 0.08;
  }
  const Eigen::MatrixXd joints = JointTrajectories(skeleton_, Retarget(skeleton_, source));
  const int toe = skeleton_.FindJointIndex(kLeftToe);
  const int heel = skeleton_.FindJointIndex(kLeftHeel);
  for (int f = 0; f < joints.cols(); ++f) {
    EXPECT_NEAR(joints(3 * toe + 1, f), joints(3 * heel + 1, f), 0.02);
  }
}

TEST_F(RetargetTest, AHeadWhoseEndLiesAsideIsTheHeadJoint) {
  SourceMotion source = AsSource(skeleton_, MakeMotion(skeleton_, MotionKind::kWalk, 0.2, 30), 1);
  RetargetSummary with_crown;
  const Eigen::MatrixXd expected = Retarget(skeleton_, source, &with_crown);
  source.names.push_back("Head_end");
  source.parents.push_back(2);
  for (Eigen::Matrix3Xd& positions : source.joint_positions) {
    const Eigen::Vector3d aside = positions.col(2) + Eigen::Vector3d(0.2, 0, 0);
    positions.conservativeResize(3, positions.cols() + 1);
    positions.rightCols<1>() = aside;
  }
  EXPECT_LT((Retarget(skeleton_, source) - expected).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_F(RetargetTest, NamesWhatItCannotFind) {
  SourceMotion source = AsSource(skeleton_, MakeMotion(skeleton_, MotionKind::kWalk, 0.1, 30), 1);
  source.names[4] = "tentacle";
  try {
    Retarget(skeleton_, source);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUnsupported);
    EXPECT_NE(std::string(error.what()).find("left_elbow"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("tentacle"), std::string::npos);
  }
}

TEST_F(RetargetTest, BrokenMotionsAreRefused) {
  const SourceMotion good =
      AsSource(skeleton_, MakeMotion(skeleton_, MotionKind::kWalk, 0.1, 30), 1);
  SourceMotion bad = good;
  bad.joint_positions[1](0, 3) = std::nan("");
  EXPECT_THROW(Retarget(skeleton_, bad), Error);
  bad = good;
  bad.joint_positions.clear();
  EXPECT_THROW(Retarget(skeleton_, bad), Error);
  bad = good;
  bad.parents[2] = 5;
  EXPECT_THROW(Retarget(skeleton_, bad), Error);
  bad = good;
  bad.fps = 0;
  EXPECT_THROW(Retarget(skeleton_, bad), Error);
  bad = good;
  for (Eigen::Matrix3Xd& positions : bad.joint_positions) positions.setZero();
  EXPECT_THROW(Retarget(skeleton_, bad), Error);
}

}  // namespace
}  // namespace mpc
