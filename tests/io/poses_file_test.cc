#include "mpc/io/poses_file.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "io/temp_dir.h"
#include "mpc/io/atomic_file.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

CapturedPoses SomePoses() {
  CapturedPoses captured;
  captured.video = "/a/clip with spaces.mp4";
  captured.image_fps = 12.5;
  captured.actor = "/b/\"quoted\".glb";
  captured.height_m = 1.7;
  captured.proportions.overall = 1 / 3.0;
  for (double& part : captured.proportions.part) part = 1.1 / 0.7;
  captured.fps = 29.97;
  captured.camera = Camera::FromFov(640, 480, 1);
  captured.camera.name = "left";
  captured.camera.has_extrinsics = true;
  captured.camera.camera_from_world.translation = {0.1, 1.0 / 3, -7};
  for (int n = 0; n < 8; ++n) captured.dofs.push_back("dof" + std::to_string(n));
  std::mt19937 rng(5);
  std::normal_distribution<double> normal;
  captured.poses = Eigen::MatrixXd::NullaryExpr(8, 11, [&] { return normal(rng); });
  return captured;
}

TEST(PosesFileTest, WhatIsWrittenIsReadBitForBit) {
  const testing::TempDir dir;
  const CapturedPoses written = SomePoses();
  WritePoses(dir / "poses.json", written);
  const CapturedPoses read = ReadPoses(dir / "poses.json");
  EXPECT_EQ(read.video, written.video);
  EXPECT_EQ(read.image_fps, written.image_fps);
  EXPECT_EQ(read.actor, written.actor);
  EXPECT_EQ(read.height_m, written.height_m);
  EXPECT_EQ(read.proportions.overall, written.proportions.overall);
  EXPECT_EQ(read.proportions.part, written.proportions.part);
  EXPECT_EQ(read.fps, written.fps);
  EXPECT_EQ(read.camera.name, "left");
  EXPECT_EQ(read.camera.fx, written.camera.fx);
  EXPECT_TRUE(read.camera.has_extrinsics);
  EXPECT_EQ(read.camera.camera_from_world.translation,
            written.camera.camera_from_world.translation);
  EXPECT_EQ(read.dofs, written.dofs);
  EXPECT_EQ(read.poses, written.poses);
}

TEST(PosesFileTest, BrokenFilesAreRefused) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(ReadPoses(dir / "none.json"), kFileNotFound, "none.json");
  WritePoses(dir / "poses.json", SomePoses());
  const std::string good = ReadFile(dir / "poses.json");
  for (size_t length = 0; length < good.size() - 3; length += 37) {
    dir.Write("cut.json", good.substr(0, length));
    EXPECT_MPC_ERROR(ReadPoses(dir / "cut.json"), kBadFile, "cut.json");
  }
  const auto replaced = [&](const std::string& what, const std::string& by) {
    std::string bad = good;
    bad.replace(bad.find(what), what.size(), by);
    return dir.Write("bad.json", bad);
  };
  EXPECT_MPC_ERROR(ReadPoses(replaced("mpc-poses", "mpc-report")), kBadFile, "mpc-poses");
  EXPECT_MPC_ERROR(ReadPoses(replaced("\"version\": 1", "\"version\": 2")), kUnsupported,
                   "version 2");
  EXPECT_MPC_ERROR(ReadPoses(replaced("\"dof3\",", "")), kBadFile, "frames[0]");
  EXPECT_MPC_ERROR(ReadPoses(replaced("29.97", "0")), kBadFile, "fps");
  EXPECT_MPC_ERROR(ReadPoses(replaced("29.97", "\"fast\"")), kBadFile, "fps");
  EXPECT_MPC_ERROR(ReadPoses(replaced("\"thigh\"", "\"calf\"")), kBadFile, "thigh");
}

TEST(PosesFileTest, OnlyWholePosesAreWritten) {
  const testing::TempDir dir;
  CapturedPoses captured = SomePoses();
  captured.poses(2, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_MPC_ERROR(WritePoses(dir / "poses.json", captured), kInvalidArgument, "not finite");
  captured = SomePoses();
  captured.dofs.pop_back();
  EXPECT_MPC_ERROR(WritePoses(dir / "poses.json", captured), kInvalidArgument, "7 dofs");
}

}  // namespace
}  // namespace mpc
