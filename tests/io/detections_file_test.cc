#include "mpc/io/detections_file.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "io/temp_dir.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Json = nlohmann::json;

template <typename Detections, int D>
Detections RandomDetections(const std::vector<JointId>& joints) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  Detections detections;
  detections.joints = joints;
  for (int f = 0; f < 6; ++f) {
    Eigen::Matrix<double, D, Eigen::Dynamic> x(D, joints.size());
    Eigen::VectorXd confidence(joints.size());
    for (double& value : x.reshaped()) value = 1000 * uniform(rng) - 300;
    for (double& value : confidence) value = f == 2 ? 0 : std::max(0.0, 1.2 * uniform(rng) - 0.2);
    detections.frames.push_back({x, confidence});
  }
  return detections;
}

template <typename Frames>
double LargestDifference(const Frames& a, const Frames& b) {
  double largest = 0;
  for (size_t f = 0; f < a.size(); ++f) {
    largest = std::max(largest, (a[f].confidence - b[f].confidence).cwiseAbs().maxCoeff());
    for (Eigen::Index j = 0; j < a[f].confidence.size(); ++j) {
      if (a[f].confidence[j] == 0) continue;
      if constexpr (requires { a[f].pixels; }) {
        largest = std::max(largest, (a[f].pixels.col(j) - b[f].pixels.col(j)).norm());
      } else {
        largest = std::max(largest, (a[f].positions.col(j) - b[f].positions.col(j)).norm());
      }
    }
  }
  return largest;
}

TEST(DetectionsFileTest, OwnFormatRoundTrip) {
  const testing::TempDir dir;
  auto d2 = RandomDetections<Detections2d, 2>({JointId::kNeck, JointId::kLeftToe, JointId::kNose});
  d2.width = 640;
  d2.height = 480;
  WriteDetections(dir / "2d.json", d2);
  const Detections2d read2 = ReadDetections2d(dir / "2d.json");
  EXPECT_EQ(read2.joints, d2.joints);
  EXPECT_EQ(read2.width, 640);
  EXPECT_EQ(read2.height, 480);
  ASSERT_EQ(read2.frames.size(), 6u);
  EXPECT_LT(LargestDifference(d2.frames, read2.frames), 1e-4);
  EXPECT_EQ(read2.frames[2].confidence.maxCoeff(), 0);

  for (const bool ray_aligned : {false, true}) {
    auto d3 = RandomDetections<Detections3d, 3>({JointId::kPelvis, JointId::kRightHip});
    d3.ray_aligned = ray_aligned;
    WriteDetections(dir / "3d.json", d3);
    const Detections3d read3 = ReadDetections3d(dir / "3d.json");
    EXPECT_EQ(read3.ray_aligned, ray_aligned);
    EXPECT_EQ(read3.joints, d3.joints);
    EXPECT_LT(LargestDifference(d3.frames, read3.frames), 2e-6);
  }
  EXPECT_MPC_ERROR(ReadDetections3d(dir / "2d.json"), kUnsupported, "3D");
  EXPECT_MPC_ERROR(ReadDetections2d(dir / "3d.json"), kUnsupported, "2D");
  EXPECT_MPC_ERROR(WriteDetections("/dev/full", d2), kWriteFailed, "/dev/full");
}

TEST(DetectionsFileTest, OpenPoseNamesAndGaps) {
  const testing::TempDir dir;
  const std::string text =
      R"({"names": ["Nose", "Tail", "Head", "LBigToe"],
          "det": [[[1, 2, 0.5], [9, 9, 0.9], [3, 4, 1.02], [0, 0, 0]], null]})";
  const Detections2d detections = ReadDetections2d(dir.Write("a.json", text));
  EXPECT_EQ(detections.joints,
            (std::vector<JointId>{JointId::kNose, JointId::kHeadTop, JointId::kLeftToe}));
  ASSERT_EQ(detections.frames.size(), 2u);
  EXPECT_EQ(detections.frames[0].pixels.col(1), Eigen::Vector2d(3, 4));
  EXPECT_EQ(detections.frames[0].confidence, Eigen::Vector3d(0.5, 1, 0));
  EXPECT_EQ(detections.frames[1].confidence, Eigen::Vector3d(0, 0, 0));
  EXPECT_MPC_ERROR(ReadDetections3d(dir / "a.json"), kUnsupported, "OpenPose");
}

// A person whose 33 landmarks lie at `origin` plus small known offsets.
Json Person(int id, double size, double visibility) {
  Json person;
  if (id >= 0) person["id"] = id;
  for (int i = 0; i < 33; ++i) {
    const double y = (i <= 10 ? -7 : i <= 12 ? -5 : 0) * size;
    person["landmarks"].push_back({size * i, y, 5, visibility, 0.5});
    person["world"].push_back({0.01 * i, i <= 10 ? -0.7 : i <= 12 ? -0.5 : 0.0, 0.1});
  }
  return person;
}

TEST(DetectionsFileTest, BlazePoseFollowsTheLargestPerson) {
  const testing::TempDir dir;
  Json file;
  file["width"] = 640;
  file["height"] = 480;
  file["frames"].push_back({{"frame", 0}, {"persons", {Person(4, 1, 1), Person(7, 10, 0.8)}}});
  file["frames"].push_back({{"frame", 1}, {"persons", Json::array({Person(4, 2, 1)})}});
  file["frames"].push_back({{"frame", 2}, {"persons", Json::array()}});
  const auto path = dir.Write("a.json", file.dump());
  const Detections2d detections = ReadDetections2d(path);
  EXPECT_EQ(detections.width, 640);
  ASSERT_EQ(detections.frames.size(), 3u);
  const int wrist = FindColumn(detections.joints, JointId::kRightWrist);
  EXPECT_EQ(detections.frames[0].pixels.col(wrist), Eigen::Vector2d(160, 0));
  EXPECT_NEAR(detections.frames[0].confidence[wrist], 0.4, 1e-12);
  EXPECT_EQ(detections.frames[1].confidence.maxCoeff(), 0);  // person 7 is not there
  EXPECT_EQ(detections.frames[2].confidence.maxCoeff(), 0);

  // Without ids: the largest of each frame.
  for (Json& frame : file["frames"]) {
    for (Json& person : frame["persons"]) person.erase("id");
  }
  const Detections2d by_size = ReadDetections2d(dir.Write("b.json", file.dump()));
  EXPECT_EQ(by_size.frames[1].pixels.col(wrist), Eigen::Vector2d(32, 0));
}

TEST(DetectionsFileTest, BlazePoseJointsAreComputedFromLandmarks) {
  const testing::TempDir dir;
  Json file;
  file["frames"].push_back({{"persons", Json::array({Person(0, 1, 1)})}});
  const Detections3d d3 = ReadDetections3d(dir.Write("a.json", file.dump()));
  EXPECT_TRUE(d3.ray_aligned);
  const auto at = [&](JointId joint) -> Eigen::Vector3d {
    return d3.frames[0].positions.col(FindColumn(d3.joints, joint));
  };
  // Shoulders at y = -0.5, ears at -0.7, hips at 0; x is 0.01 per landmark.
  EXPECT_TRUE(at(JointId::kLeftHip).isApprox(Eigen::Vector3d(0.23 - 0.07 * 0.12, -0.035, 0.1)));
  EXPECT_TRUE(at(JointId::kPelvis).isApprox(Eigen::Vector3d(0.235 - 0.07 * 0.12, -0.035, 0.1)));
  EXPECT_TRUE(at(JointId::kNeck).isApprox(Eigen::Vector3d(0.115 - 0.35 * 0.04, -0.57, 0.1)));
  EXPECT_TRUE(at(JointId::kHeadTop).isApprox(Eigen::Vector3d(0.115 - 1.8 * 0.04, -0.86, 0.1)));
  EXPECT_TRUE(at(JointId::kRightToe).isApprox(Eigen::Vector3d(0.32, 0, 0.1)));
}

TEST(DetectionsFileTest, NamesTheFaultInABrokenFile) {
  const testing::TempDir dir;
  const auto read = [&](const std::string& text) { ReadDetections2d(dir.Write("a.json", text)); };
  const std::string own = R"({"format": "mpc-detections", "version": 1, "dimensions": 2, )";
  EXPECT_MPC_ERROR(ReadDetections2d(dir / "no.json"), kFileNotFound, "no.json");
  EXPECT_MPC_ERROR(read(""), kBadFile, "not valid JSON");
  EXPECT_MPC_ERROR(read("3"), kBadFile, "no detection file");
  EXPECT_MPC_ERROR(read("{}"), kBadFile, "no detection file");
  EXPECT_MPC_ERROR(read(R"({"names": [], "det": []})"), kBadFile, "no known joint");
  EXPECT_MPC_ERROR(read(R"({"names": ["Nose"], "det": []})"), kBadFile, "no frame");
  EXPECT_MPC_ERROR(read(R"({"names": ["Nose", "Nose"], "det": []})"), kBadFile, "repeats");
  EXPECT_MPC_ERROR(read(R"({"names": ["Nose"], "det": [[]]})"), kBadFile, "det[0]");
  EXPECT_MPC_ERROR(read(R"({"names": ["Nose"], "det": [[[1, 2]]]})"), kBadFile, "det[0][0]");
  EXPECT_MPC_ERROR(read(R"({"names": ["Nose"], "det": [[[1, 2, 9]]]})"), kBadFile, "confidence");
  EXPECT_MPC_ERROR(read(R"({"names": ["Nose"], "det": [[[NaN, 2, 1]]]})"), kBadFile, "JSON");
  EXPECT_MPC_ERROR(read(R"({"names": ["Nose"], "det": [[["1", 2, 1]]]})"), kBadFile, "a number");
  EXPECT_MPC_ERROR(read(R"({"frames": [{}]})"), kBadFile, "persons");
  EXPECT_MPC_ERROR(read(R"({"frames": [{"frame": 5, "persons": []}]})"), kBadFile,
                   "frame number 5");
  EXPECT_MPC_ERROR(read(R"({"frames": [{"persons": [{"landmarks": [[1, 2]]}]}]})"), kBadFile, "33");
  EXPECT_MPC_ERROR(read(R"({"joints": ["neck"], "frames": [null]})"), kBadFile, "format");
  EXPECT_MPC_ERROR(read(own + R"("joints": ["tail"], "frames": [null]})"), kBadFile, "tail");
  EXPECT_MPC_ERROR(read(own + R"("joints": ["neck", "neck"], "frames": [null]})"), kBadFile,
                   "repeats");
  EXPECT_MPC_ERROR(read(own + R"("joints": ["neck"], "frames": []})"), kBadFile, "no frame");
  EXPECT_MPC_ERROR(read(own + R"("joints": ["neck"], "frames": [[[1, 2, 3, 1]]]})"), kBadFile,
                   "frames[0][0]");
  EXPECT_MPC_ERROR(read(R"({"format": "mpc-detections", "version": 2, "dimensions": 2,
                            "joints": ["neck"], "frames": [null]})"),
                   kUnsupported, "version 2");
}

}  // namespace
}  // namespace mpc
