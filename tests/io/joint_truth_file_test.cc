#include "mpc/io/joint_truth_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "io/temp_dir.h"
#include "mpc/io/trc.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

TEST(JointTruthFileTest, ReadsTrcByOurNames) {
  const testing::TempDir dir;
  MarkerTrajectories markers;
  markers.names = {"left_elbow", "C7", "neck"};
  markers.fps = 50;
  markers.positions = Eigen::MatrixXd::Random(9, 4);
  markers.positions(7, 2) = std::numeric_limits<double>::quiet_NaN();
  WriteTrc(dir / "a.trc", markers);
  const JointTrack read = ReadJointTrack(dir / "a.trc");
  EXPECT_EQ(read.joints, (std::vector<JointId>{JointId::kLeftElbow, JointId::kNeck}));
  EXPECT_EQ(read.fps, 50);
  ASSERT_EQ(read.num_frames(), 4);
  EXPECT_LT((read.positions.topRows(3) - markers.positions.topRows(3)).norm(), 1e-5);
  EXPECT_NEAR(read.positions(4, 1), markers.positions(7, 1), 1e-6);
  EXPECT_TRUE(std::isnan(read.positions(4, 2)));
}

TEST(JointTruthFileTest, ReadsJsonByOpenPoseNames) {
  const testing::TempDir dir;
  const JointTrack read = ReadJointTrack(dir.Write("a.json", R"(
      {"fps": 60, "names": ["Tail", "LElbow", "Head"],
       "joints": [[[9, 9, 9], [1, 2, 3], [4, 5, 6]],
                  [[9, 9, 9], [null, null, null], [7, 8, 9]]]})"));
  EXPECT_EQ(read.joints, (std::vector<JointId>{JointId::kLeftElbow, JointId::kHeadTop}));
  EXPECT_EQ(read.fps, 60);
  ASSERT_EQ(read.num_frames(), 2);
  EXPECT_EQ(read.positions(2, 0), 3);
  EXPECT_EQ(read.positions(5, 1), 9);
  EXPECT_TRUE(std::isnan(read.positions(0, 1)));
}

TEST(JointTruthFileTest, NamesTheFaultInABrokenFile) {
  const testing::TempDir dir;
  const auto read = [&](const std::string& text) { ReadJointTrack(dir.Write("a.json", text)); };
  EXPECT_MPC_ERROR(ReadJointTrack(dir / "no.trc"), kFileNotFound, "no.trc");
  EXPECT_MPC_ERROR(read(""), kBadFile, "a.json");
  EXPECT_MPC_ERROR(read("{"), kBadFile, "not valid JSON");
  EXPECT_MPC_ERROR(read(R"({"fps": 0, "names": [], "joints": []})"), kBadFile, "fps");
  EXPECT_MPC_ERROR(read(R"({"fps": 1, "names": ["Tail"], "joints": []})"), kBadFile, "no joint");
  EXPECT_MPC_ERROR(read(R"({"fps": 1, "names": ["Neck"], "joints": [[]]})"), kBadFile, "joints[0]");
  EXPECT_MPC_ERROR(read(R"({"fps": 1, "names": ["Neck"], "joints": [[[1, 2]]]})"), kBadFile,
                   "joints[0][0]");
}

}  // namespace
}  // namespace mpc
