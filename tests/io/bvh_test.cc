#include "mpc/io/bvh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "io/random_motion.h"
#include "io/temp_dir.h"
#include "mpc/skeleton/kinematics.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

// The joints of the pose that are segment origins or ends, found in the BVH, agree with ours.
void ExpectSameAsSkeleton(const Skeleton& skeleton, const Eigen::MatrixXd& poses,
                          const BvhMotion& motion, double tolerance) {
  ASSERT_EQ(motion.num_frames(), poses.cols());
  KinematicState state;
  for (int f = 0; f < poses.cols(); ++f) {
    ForwardKinematics(skeleton, poses.col(f), &state);
    const std::vector<Eigen::Isometry3d> world_from_joint = BvhJointTransforms(motion, f);
    int num_ends = 0;
    for (int s = 0; s < skeleton.num_segments(); ++s) {
      const int joint = motion.FindJoint(skeleton.segments[s].name);
      ASSERT_GE(joint, 0);
      ASSERT_LT((world_from_joint[joint].translation() - state.origins.col(s)).norm(), tolerance)
          << skeleton.segments[s].name << " frame " << f;
      const auto& end = motion.joints[joint].end_site;
      if (!end) continue;
      ++num_ends;
      const Eigen::Vector3d x = world_from_joint[joint] * *end;
      ASSERT_LT((state.joints.colwise() - x).colwise().norm().minCoeff(), tolerance);
    }
    ASSERT_EQ(num_ends, 5);  // head, hands, feet
  }
}

// The same skeleton with segments whose own axes point anywhere.
Skeleton WithTurnedSegments(Skeleton skeleton) {
  for (int s = 0; s < skeleton.num_segments(); ++s) {
    skeleton.segments[s].rest_rotation =
        Eigen::AngleAxisd(0.3 * s + 0.2, Eigen::Vector3d(s, 1, -2).normalized()).toRotationMatrix();
  }
  return skeleton;
}

TEST(BvhTest, SegmentsMayHaveAnyAxes) {
  const Skeleton skeleton = WithTurnedSegments(DefaultSkeleton());
  const Eigen::MatrixXd poses = testing::RandomMotion(skeleton, 10, 3);
  ExpectSameAsSkeleton(skeleton, poses, BvhFromPoses(skeleton, poses, 30), 1e-9);
}

TEST(BvhTest, FromPosesAndThroughAFileKeepsEveryJoint) {
  const testing::TempDir dir;
  const Skeleton skeleton = DefaultSkeleton();
  const Eigen::MatrixXd poses = testing::RandomMotion(skeleton, 60, 1);
  const BvhMotion motion = BvhFromPoses(skeleton, poses, 30);
  ExpectSameAsSkeleton(skeleton, poses, motion, 1e-9);
  WriteBvh(dir / "a.bvh", motion);
  const BvhMotion read = ReadBvh(dir / "a.bvh");
  ExpectSameAsSkeleton(skeleton, poses, read, 1e-6);
  EXPECT_NEAR(read.frame_time_s, 1.0 / 30, 1e-9);
}

TEST(BvhTest, ZeroPoseHasZeroAngles) {
  const Skeleton skeleton = DefaultSkeleton();
  const BvhMotion motion = BvhFromPoses(skeleton, ZeroPose(skeleton), 30);
  EXPECT_LT(motion.values.cwiseAbs().maxCoeff(), 1e-12);
}

TEST(BvhTest, AnglesAreContinuous) {
  const Skeleton skeleton = DefaultSkeleton();
  const Eigen::MatrixXd poses = testing::RandomMotion(skeleton, 400, 2);
  const BvhMotion motion = BvhFromPoses(skeleton, poses, 120);
  const Eigen::MatrixXd steps =
      motion.values.rightCols(poses.cols() - 1) - motion.values.leftCols(poses.cols() - 1);
  // Near the singularity of the middle angle steps grow, but a jump would be 180 degrees.
  EXPECT_LT(steps.cwiseAbs().maxCoeff(), 90);
  EXPECT_GT(motion.values.row(5).maxCoeff() - motion.values.row(5).minCoeff(), 600);
}

// All orders of rotation channels against the product written out.
TEST(BvhTest, ReadsEveryChannelOrder) {
  const testing::TempDir dir;
  const std::string axes = "XYZ";
  const Eigen::Vector3d angles(20, -50, 110);  // degrees, in the order of the channels
  for (const std::string order : {"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"}) {
    std::string text = "HIERARCHY\r\nROOT hip joint\r\n{\r\n\tOFFSET 1 2 3\r\n\tCHANNELS 3";
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    for (int i = 0; i < 3; ++i) {
      text += std::string(" ") + order[i] + "rotation";
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(static_cast<int>(axes.find(order[i])));
      rotation *= Eigen::AngleAxisd(angles[i] * std::numbers::pi / 180, axis).toRotationMatrix();
    }
    text +=
        "\r\n\tJOINT a\r\n\t{\r\n\tOFFSET 0 1e1 0\r\n\tCHANNELS 3 Zposition Xposition Yposition\r\n"
        "\tEnd Site\r\n{\r\nOFFSET 0 0 +1\r\n}\r\n}\r\n}\r\n"
        "MOTION\r\nFrames: 1\r\nFrame Time: 0.01\r\n20 -50 110 3 1 2\r\n";
    const BvhMotion motion = ReadBvh(dir.Write("a.bvh", text));
    ASSERT_EQ(motion.joints.size(), 2u);
    EXPECT_EQ(motion.joints[0].name, "hip joint");
    ASSERT_TRUE(motion.joints[1].end_site.has_value());
    const std::vector<Eigen::Isometry3d> joints = BvhJointTransforms(motion, 0);
    EXPECT_TRUE(joints[0].linear().isApprox(rotation, 1e-12)) << order;
    const Eigen::Vector3d expected = Eigen::Vector3d(1, 2, 3) + rotation * Eigen::Vector3d(1, 2, 3);
    EXPECT_TRUE(joints[1].translation().isApprox(expected, 1e-12)) << order;
  }
}

TEST(BvhTest, FileRoundTripKeepsBranchesAndSeveralRoots) {
  const testing::TempDir dir;
  BvhMotion motion;
  const auto add = [&](const char* name, int parent) {
    BvhJoint joint;
    joint.name = name;
    joint.parent = parent;
    joint.offset = {0.1 * parent, 1, -2};
    joint.channels = {BvhChannel::kYRotation, BvhChannel::kXRotation};
    motion.joints.push_back(joint);
  };
  add("r", -1), add("a", 0), add("b", 1), add("c", 0), add("q", -1), add("d", 4);
  motion.frame_time_s = 0.1;
  motion.values = Eigen::MatrixXd::Random(12, 3);
  WriteBvh(dir / "a.bvh", motion);
  const BvhMotion read = ReadBvh(dir / "a.bvh");
  ASSERT_EQ(read.joints.size(), motion.joints.size());
  for (size_t i = 0; i < read.joints.size(); ++i) {
    EXPECT_EQ(read.joints[i].name, motion.joints[i].name);
    EXPECT_EQ(read.joints[i].parent, motion.joints[i].parent);
    EXPECT_LT((read.joints[i].offset - motion.joints[i].offset).norm(), 1e-7);
  }
  EXPECT_LT((read.values - motion.values).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(BvhTest, RefusesWhatCannotBeWritten) {
  const testing::TempDir dir;
  const Skeleton skeleton = DefaultSkeleton();
  Eigen::MatrixXd poses = testing::RandomMotion(skeleton, 3, 1);
  EXPECT_MPC_ERROR(BvhFromPoses(skeleton, poses.topRows(5), 30), kInvalidArgument, "5 x 3");
  EXPECT_MPC_ERROR(BvhFromPoses(skeleton, poses, 0), kInvalidArgument, "frames per second");
  poses(7, 1) = std::nan("");
  EXPECT_MPC_ERROR(BvhFromPoses(skeleton, poses, 30), kInvalidArgument, "finite");
  BvhMotion motion;
  EXPECT_MPC_ERROR(WriteBvh(dir / "a.bvh", motion), kInvalidArgument, "no joint");
  EXPECT_MPC_ERROR(BvhJointTransforms(motion, 0), kInvalidArgument, "frame 0 of 0");
}

struct BrokenBvh {
  const char* name;
  std::string text;
  const char* message;
};

TEST(BvhTest, NamesTheFaultInABrokenFile) {
  const testing::TempDir dir;
  const std::string head =
      "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n}\n";
  const std::vector<BrokenBvh> table = {
      {"empty", "", "the file ends here"},
      {"other", "glTF\1\2", "expected HIERARCHY"},
      {"no joint", "HIERARCHY\nMOTION\n", "no joint"},
      {"no motion", head, "the file ends here"},
      {"negative frames", head + "MOTION\nFrames: -1\n", "number of frames"},
      {"huge frames", head + "MOTION\nFrames: 99999999\nFrame Time: 0.1\n1 2 3\n", "do not fit"},
      {"absurd frames", head + "MOTION\nFrames: 99999999999999999999\n", "number of frames"},
      {"zero time", head + "MOTION\nFrames: 1\nFrame Time: 0\n1 2 3\n", "frame time"},
      {"nan", head + "MOTION\nFrames: 1\nFrame Time: 0.1\n1 nan 3\n", "finite number"},
      {"inf", head + "MOTION\nFrames: 1\nFrame Time: 0.1\n1 1e999 3\n", "finite number"},
      {"short", head + "MOTION\nFrames: 2\nFrame Time: 0.1\n1 2 3\n4 5\n", "the file ends here"},
      {"channel", "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\nCHANNELS 1 Wrotation\n}\n", "Wrotation"},
      {"twice", "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\nCHANNELS 2 Xrotation Xrotation\n}\n", "twice"},
      {"count", "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\nCHANNELS 7 Xrotation\n}\n", "channels"},
      {"brace", head + "}\nMOTION\n", "without its"},
      {"stray joint", head + "JOINT a\n{\n", "outside of a ROOT"},
  };
  for (const BrokenBvh& broken : table) {
    SCOPED_TRACE(broken.name);
    EXPECT_MPC_ERROR(ReadBvh(dir.Write("a.bvh", broken.text)), kBadFile, broken.message);
  }
  EXPECT_MPC_ERROR(ReadBvh(dir / "missing.bvh"), kFileNotFound, "missing.bvh");
  EXPECT_MPC_ERROR(ReadBvh(dir.Write("a.bvh", head + "\n\nROOT\n(")), kBadFile, "a.bvh:10");
}

}  // namespace
}  // namespace mpc
