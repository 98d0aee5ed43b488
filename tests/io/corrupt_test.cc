// Every reader on files that are damaged at random: it reads something or throws mpc::Error, and
// never crashes, hangs or takes memory without bound. Run under the sanitizers as well.
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "io/random_motion.h"
#include "io/temp_dir.h"
#include "io/test_gltf.h"
#include "mpc/core/error.h"
#include "mpc/core/log.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/bvh.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/gltf.h"
#include "mpc/io/joint_truth_file.h"
#include "mpc/io/trc.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Read = std::function<void(const std::filesystem::path&)>;

class CorruptTest : public ::testing::Test {
 protected:
  CorruptTest() {
    SetLogSink([](LogLevel, std::string_view) {});
  }
  ~CorruptTest() override { SetLogSink({}); }

  // How often the damaged text was refused. Damage is kept within the first `reach` bytes.
  int NumRefused(const std::string& good, size_t reach, const Read& read) {
    int num_refused = 0;
    const auto attempt = [&](const std::string& bytes) {
      try {
        read(dir_.Write(name_, bytes));
      } catch (const Error&) {
        ++num_refused;
      }
    };
    read(dir_.Write(name_, good));  // the undamaged file is good
    reach = std::min(reach, good.size());
    for (int i = 0; i < 30; ++i) attempt(good.substr(0, good.size() * i / 30));
    std::uniform_int_distribution<size_t> position(0, reach - 1);
    std::uniform_int_distribution<int> byte(0, 255);
    const std::string useful = "0123456789-+.eE{}[]\",: \n\tnull";
    for (int i = 0; i < 300; ++i) {
      std::string bytes = good;
      const int num_flips = 1 << (i % 5);
      for (int flip = 0; flip < num_flips; ++flip) {
        const char c = i % 2 ? static_cast<char>(byte(rng_))
                             : useful[static_cast<size_t>(byte(rng_)) % useful.size()];
        bytes[position(rng_)] = c;
      }
      // Pieces taken out, or doubled.
      const size_t at = position(rng_);
      if (i % 7 == 0) bytes.erase(at, 100);
      if (i % 11 == 0) bytes.insert(std::min(at, bytes.size()), bytes.substr(0, 50));
      attempt(bytes);
    }
    return num_refused;
  }

  testing::TempDir dir_;
  std::string name_ = "damaged";
  std::mt19937 rng_{17};
};

TEST_F(CorruptTest, Bvh) {
  const Skeleton skeleton = DefaultSkeleton();
  WriteBvh(dir_ / "good", BvhFromPoses(skeleton, testing::RandomMotion(skeleton, 5, 1), 30));
  const std::string good = ReadFile(dir_ / "good");
  EXPECT_GT(NumRefused(good, good.size(), [](const auto& path) { ReadBvh(path); }), 25);
}

TEST_F(CorruptTest, Trc) {
  WriteTrc(dir_ / "good", {{"a", "b", "c"}, 30, Eigen::MatrixXd::Random(9, 12)});
  const std::string good = ReadFile(dir_ / "good");
  EXPECT_GT(NumRefused(good, good.size(), [](const auto& path) { ReadTrc(path); }), 25);
}

TEST_F(CorruptTest, Cameras) {
  const std::string good =
      R"({"cameras": [{"name": "a", "width": 640, "height": 480, "fx": 500, "fy": 500, "cx": 320,
      "cy": 240, "dist": [0, 0, 0, 0, 0], "R": [[1,0,0],[0,1,0],[0,0,1]], "t": [0,0,1]}]})";
  EXPECT_GT(NumRefused(good, good.size(), [](const auto& path) { ReadCameras(path); }), 25);
}

TEST_F(CorruptTest, OpenPose) {
  const std::string good =
      R"({"names": ["Nose", "Neck"], "det": [[[1, 2, 0.5], [3, 4, 1]], [[1, 2, 0], [3, 4, 1]]]})";
  EXPECT_GT(NumRefused(good, good.size(), [](const auto& path) { ReadDetections2d(path); }), 25);
}

TEST_F(CorruptTest, BlazePose) {
  std::string person = R"({"id": 1, "landmarks": [)";
  for (int i = 0; i < 33; ++i) person += std::string(i ? "," : "") + "[1, 2, 3, 0.5, 1]";
  person += R"(], "world": [)";
  for (int i = 0; i < 33; ++i) person += std::string(i ? "," : "") + "[0.1, 0.2, 0.3]";
  const std::string good = R"({"frames": [{"frame": 0, "persons": [)" + person + "]}]}]}";
  const Read read_both = [](const auto& path) {
    ReadDetections3d(path);
    ReadDetections2d(path);
  };
  EXPECT_GT(NumRefused(good, good.size(), read_both), 25);
}

TEST_F(CorruptTest, OwnDetections) {
  const std::string good = R"({"format": "mpc-detections", "version": 1, "dimensions": 3,
      "joints": ["neck", "nose"], "frames": [null, [[1, 2, 3, 1], null]]})";
  EXPECT_GT(NumRefused(good, good.size(), [](const auto& path) { ReadDetections3d(path); }), 25);
}

TEST_F(CorruptTest, JointTruth) {
  const std::string good =
      R"({"fps": 60, "names": ["LElbow", "Head"], "joints": [[[1, 2, 3], [null, null, null]]]})";
  EXPECT_GT(NumRefused(good, good.size(), [](const auto& path) { ReadJointTrack(path); }), 25);
}

// The damage lies in the JSON only, or anywhere.
class CorruptGltfTest : public CorruptTest {
 protected:
  void Check(const testing::TestGltfOptions& options, bool json_only) {
    testing::TestGltf file(testing::MakeTestRig(), options);
    const std::string good = file.Bytes();
    name_ = options.data_uri ? "damaged.gltf" : "damaged.glb";
    // What can be read can be written again.
    const Read round_trip = [&](const auto& path) {
      const RigAsset rig = ReadRigGltf(path);
      GltfPerformance performance;
      performance.times_s = {0};
      performance.scene_from_bone.emplace_back();
      for (const RigBone& bone : rig.bones) {
        performance.scene_from_bone[0].push_back(bone.scene_from_bone);
      }
      performance.camera = Camera::FromFov(640, 480, 1);
      WriteGltfPerformance(dir_ / "out.glb", path, rig, performance);
    };
    const size_t reach = json_only ? file.json.dump().size() + 20 : good.size();
    EXPECT_GT(NumRefused(good, reach, round_trip), 25);
  }
};

TEST_F(CorruptGltfTest, BinaryJson) { Check({.sparse = true, .old_animation = true}, true); }
TEST_F(CorruptGltfTest, BinaryAll) { Check({.sparse = true, .old_animation = true}, false); }
TEST_F(CorruptGltfTest, TextJson) { Check({.data_uri = true}, true); }
TEST_F(CorruptGltfTest, TextAll) { Check({.data_uri = true}, false); }

}  // namespace
}  // namespace mpc
