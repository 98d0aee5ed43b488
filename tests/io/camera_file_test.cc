#include "mpc/io/camera_file.h"

#include <gtest/gtest.h>

#include "io/temp_dir.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

constexpr const char* kFull =
    R"({"name": "left", "width": 640, "height": 480, "fx": 500, "fy": 501, "cx": 320, "cy": 240,
        "dist": [0.1, -0.2, 0.001, 0.002, 0.03], "R": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        "t": [1, 2, 3], "center": "ignored"})";
constexpr const char* kPlain =
    R"({"name": "right", "width": 640, "height": 480, "fx": 500, "fy": 500, "cx": 320, "cy": 240})";

std::string File(const std::string& cameras) { return "{\"cameras\": [" + cameras + "]}"; }

TEST(CameraFileTest, ReadsEveryField) {
  const testing::TempDir dir;
  const std::vector<Camera> cameras =
      ReadCameras(dir.Write("c.json", File(std::string(kFull) + "," + kPlain)));
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[0].name, "left");
  EXPECT_EQ(cameras[0].height, 480);
  EXPECT_EQ(cameras[0].fy, 501);
  EXPECT_EQ(cameras[0].distortion[4], 0.03);
  EXPECT_TRUE(cameras[0].has_extrinsics);
  EXPECT_TRUE((cameras[0].camera_from_world * Eigen::Vector3d(10, 20, 30))
                  .isApprox(Eigen::Vector3d(21, -8, 33)));
  EXPECT_FALSE(cameras[1].has_extrinsics);
}

TEST(CameraFileTest, RoundTrip) {
  const testing::TempDir dir;
  const std::vector<Camera> cameras =
      ReadCameras(dir.Write("c.json", File(std::string(kFull) + "," + kPlain)));
  WriteCameras(dir / "d.json", cameras);
  const std::vector<Camera> read = ReadCameras(dir / "d.json");
  ASSERT_EQ(read.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read[i].name, cameras[i].name);
    EXPECT_EQ(read[i].width, cameras[i].width);
    EXPECT_NEAR(read[i].fy, cameras[i].fy, 1e-6);
    EXPECT_EQ(read[i].distortion, cameras[i].distortion);
    EXPECT_EQ(read[i].has_extrinsics, cameras[i].has_extrinsics);
    const Eigen::Vector3d x(1, 2, 3);
    EXPECT_LT((read[i].camera_from_world * x - cameras[i].camera_from_world * x).norm(), 1e-9);
  }
  EXPECT_MPC_ERROR(WriteCameras("/dev/full", cameras), kWriteFailed, "/dev/full");
}

TEST(CameraFileTest, ChoosesByName) {
  const testing::TempDir dir;
  const std::string one = dir.Write("one.json", File(kFull)).string();
  const std::string two = dir.Write("a:two.json", File(std::string(kFull) + "," + kPlain)).string();
  EXPECT_EQ(ReadCamera(one).name, "left");
  EXPECT_EQ(ReadCamera(one + ":left").name, "left");
  EXPECT_EQ(ReadCamera(two + ":right").name, "right");
  EXPECT_MPC_ERROR(ReadCamera(two), kInvalidArgument, "left, right");
  EXPECT_MPC_ERROR(ReadCamera(two + ":up"), kInvalidArgument, "left, right");
  EXPECT_MPC_ERROR(ReadCamera((dir / "no.json").string() + ":up"), kFileNotFound, "no.json");
}

TEST(CameraFileTest, NamesTheFaultInABrokenFile) {
  const testing::TempDir dir;
  const auto broken = [&](const std::string& from, const std::string& to) {
    std::string text = File(kFull);
    text.replace(text.find(from), from.size(), to);
    return dir.Write("c.json", text);
  };
  EXPECT_MPC_ERROR(ReadCameras(dir.Write("c.json", "")), kBadFile, "not valid JSON");
  EXPECT_MPC_ERROR(ReadCameras(dir.Write("c.json", "[]")), kBadFile, "expected an object");
  EXPECT_MPC_ERROR(ReadCameras(dir.Write("c.json", File(""))), kBadFile, "no camera");
  EXPECT_MPC_ERROR(ReadCameras(dir.Write("c.json", std::string(100000, '['))), kBadFile, "nested");
  EXPECT_MPC_ERROR(ReadCameras(dir.Write("c.json", File(std::string(kPlain) + "," + kPlain))),
                   kBadFile, "repeats the camera name");
  EXPECT_MPC_ERROR(ReadCameras(broken("\"fx\": 500", "\"fx\": 0")), kBadFile, "left");
  EXPECT_MPC_ERROR(ReadCameras(broken("\"fx\": 500", "\"fx\": \"a\"")), kBadFile, "cameras[0].fx");
  EXPECT_MPC_ERROR(ReadCameras(broken("\"fx\": 500", "\"fx\": 1e999")), kBadFile, "JSON");
  EXPECT_MPC_ERROR(ReadCameras(broken("\"fx\": 500", "\"f\": 500")), kBadFile, "fx");
  EXPECT_MPC_ERROR(ReadCameras(broken("640", "-640")), kBadFile, "left");
  EXPECT_MPC_ERROR(ReadCameras(broken("640", "1e12")), kBadFile, "width");
  EXPECT_MPC_ERROR(ReadCameras(broken("[0, 1, 0]", "[0, 1.01, 0]")), kBadFile, "left");
  EXPECT_MPC_ERROR(ReadCameras(broken("[0, 1, 0]", "[0, 1]")), kBadFile, "expected 3");
  EXPECT_MPC_ERROR(ReadCameras(broken("\"t\"", "\"u\"")), kBadFile, "only one of R and t");
  EXPECT_MPC_ERROR(ReadCameras(broken("0.03]", "0.03, 0.1]")), kUnsupported, "distortion");
}

TEST(CameraFileTest, MovingCameraRoundTrip) {
  const testing::TempDir dir;
  const std::string fixed = dir.Write("c.json", File(kFull)).string();
  EXPECT_TRUE(ReadCameraMotion(fixed).empty());
  const Camera camera = ReadCamera(fixed);
  std::vector<CameraFromWorld> motion;
  for (int f = 0; f < 3; ++f) {
    motion.push_back({ExpSO3({0.1 * f, 0.2, -0.3 * f}), Eigen::Vector3d(f, 2, 3)});
  }
  const std::string moving = (dir / "d.json").string();
  WriteMovingCamera(moving, camera, motion);
  const std::vector<CameraFromWorld> read = ReadCameraMotion(moving + ":left");
  ASSERT_EQ(read.size(), 3u);
  for (size_t f = 0; f < 3; ++f) {
    EXPECT_EQ(read[f].rotation, motion[f].rotation);
    EXPECT_EQ(read[f].translation, motion[f].translation);
  }
  EXPECT_EQ(ReadCamera(moving).camera_from_world.rotation, motion[0].rotation);
  EXPECT_MPC_ERROR(WriteMovingCamera(moving, camera, {}), kInvalidArgument, "without any frame");
}

TEST(CameraFileTest, NamesTheFaultInABrokenMotion) {
  const testing::TempDir dir;
  const auto motion = [&](const std::string& frames) {
    std::string text = kPlain;
    text.replace(text.rfind('}'), 1, ", \"frames\": " + frames + "}");
    return ReadCameraMotion(dir.Write("c.json", File(text)).string());
  };
  const std::string good = R"({"R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [1, 2, 3]})";
  EXPECT_EQ(motion("[" + good + "," + good + "]").size(), 2u);
  EXPECT_MPC_ERROR(motion("[]"), kBadFile, "no frame");
  EXPECT_MPC_ERROR(motion("[" + good + ", {}]"), kBadFile, "frames[1]");
  EXPECT_MPC_ERROR(motion(R"([{"R": [[2, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [1, 2, 3]}])"),
                   kBadFile, "frames[0]");
}

}  // namespace
}  // namespace mpc
