#include "mpc/io/truth_file.h"

#include <gtest/gtest.h>

#include <string>

#include "io/temp_dir.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

TEST(TruthFileTest, WritesAndReadsAgain) {
  const testing::TempDir dir;
  TruthClip clip;
  clip.fps = 29.97;
  clip.num_frames = 90;
  clip.width = 1280;
  clip.height = 720;
  clip.has_floor = false;
  clip.motion = "walk";
  clip.outfit = "skirt";
  clip.seed = 12345678901234;
  clip.camera_motion = "pan";
  clip.noise = "off";
  clip.video = dir / "clip.mp4";
  clip.camera = dir / "camera.json";
  clip.joints = dir / "truth.trc";
  clip.masks = dir / "masks";
  WriteTruthClip(dir.path(), clip);
  for (const auto& path : {dir.path(), dir / "truth.json"}) {
    const TruthClip read = ReadTruthClip(path);
    EXPECT_EQ(read.fps, 29.97);
    EXPECT_EQ(read.num_frames, 90);
    EXPECT_EQ(read.height, 720);
    EXPECT_FALSE(read.has_floor);
    EXPECT_EQ(read.motion, "walk");
    EXPECT_EQ(read.outfit, "skirt");
    EXPECT_EQ(read.seed, 12345678901234u);
    EXPECT_EQ(read.camera_motion, "pan");
    EXPECT_EQ(read.noise, "off");
    EXPECT_EQ(read.video, dir / "clip.mp4");
    EXPECT_EQ(read.masks, dir / "masks");
    EXPECT_EQ(read.vertices, "");
    EXPECT_EQ(read.detections3d, "");
  }
}

TEST(TruthFileTest, NamesTheFaultInABrokenFile) {
  const testing::TempDir dir;
  const std::string head = R"({"format": "mpc-truth", "version": 1, )";
  const auto read = [&](const std::string& text) { ReadTruthClip(dir.Write("t.json", text)); };
  EXPECT_MPC_ERROR(ReadTruthClip(dir.path()), kFileNotFound, "truth.json");
  EXPECT_MPC_ERROR(read("{"), kBadFile, "t.json: not valid JSON");
  EXPECT_MPC_ERROR(read("[]"), kBadFile, "no format");
  EXPECT_MPC_ERROR(read(R"({"format": "mpc-truth", "version": 2})"), kUnsupported, "version 2");
  EXPECT_MPC_ERROR(read(head + R"("frames": 3})"), kBadFile, "fps");
  EXPECT_MPC_ERROR(read(head + R"("fps": 0, "frames": 3})"), kBadFile, "frame rate");
  EXPECT_MPC_ERROR(read(head + R"("fps": 30, "frames": 0})"), kBadFile, "at least 1");
  const std::string size = head + R"("fps": 30, "frames": 1, "width": 4, "height": 3, )";
  EXPECT_MPC_ERROR(read(size + R"("seed": -1})"), kBadFile, "seed");
  EXPECT_MPC_ERROR(read(size + R"("video": 3})"), kBadFile, "video is a number");
  EXPECT_MPC_ERROR(read(size + R"("floor": 1})"), kBadFile, "floor");
  EXPECT_NO_THROW(read(size + R"("video": null})"));
  EXPECT_TRUE(ReadTruthClip(dir / "t.json").has_floor);
}

}  // namespace
}  // namespace mpc
