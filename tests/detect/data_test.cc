// The networks on the real clips, against what MediaPipe's own networks said elsewhere (the given
// BlazePose files) and against OpenPose.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "man_picture.h"
#include "models_dir.h"
#include "mpc/detect/clip_detector.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/joint_truth_file.h"
#include "mpc/io/video.h"
#include "support/data_dir.h"

namespace mpc {
namespace {

// MediaPipe's picture starts at the corner of the first pixel, ours at its centre.
const Eigen::Vector2d kCorner(0.5, 0.5);

nlohmann::json ReadJson(const std::filesystem::path& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file);
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class DetectDataTest : public ::testing::TestWithParam<const char*> {
 protected:
  std::filesystem::path File(const std::string& ending) const {
    return *testing::DataDir() / "pose2sim" / (GetParam() + ending);
  }
};

TEST_P(DetectDataTest, LandmarksOfARegionEqualMediaPipes) {
  MPC_REQUIRE_DATA();
  MPC_REQUIRE_MODELS();
  const nlohmann::json given = ReadJson(File("_blazepose.json"));
  PoseLandmarker landmarker(Network::Read(FindPoseModels().landmarker));
  VideoReader video(File(".mp4"));
  cv::Mat picture;
  std::vector<double> errors_px, errors_m;
  for (int f = 0; f <= 60 && video.Read(&picture); ++f) {
    if (f % 30 != 0) continue;
    const nlohmann::json& person = given["frames"][f]["persons"][0];
    const nlohmann::json& roi = person["roi"];
    const PersonPose pose =
        landmarker.Find(picture, {.center = Eigen::Vector2d(roi[0], roi[1]) - kCorner,
                                  .size_px = roi[2],
                                  .rotation_rad = roi[3]});
    EXPECT_GT(pose.score, 0.99);
    for (int i = 0; i < kNumBlazePoseLandmarks; ++i) {
      const nlohmann::json& pixel = person["landmarks"][i];
      const nlohmann::json& world = person["world"][i];
      errors_px.push_back(
          (pose.pixels.col(i) + kCorner - Eigen::Vector2d(pixel[0], pixel[1])).norm());
      errors_m.push_back(
          (pose.world.col(i) - Eigen::Vector3d(world[0], world[1], world[2])).norm());
    }
  }
  std::printf("%s: median difference %.2f px, %.1f mm\n", GetParam(), Median(errors_px),
              1e3 * Median(errors_m));
  EXPECT_LT(Median(errors_px), 1);
  EXPECT_LT(Median(errors_m), 0.005);
}

INSTANTIATE_TEST_SUITE_P(Clips, DetectDataTest, ::testing::Values("cam01", "cam03"));

// Joints of a clip that lie near those of the reference, of `all`, and nearer to those of the other
// side.
struct Agreement {
  int all = 0;
  int near = 0;
  int swapped = 0;

  double percent() const { return 100.0 * near / all; }
  void operator+=(const Agreement& other) {
    all += other.all;
    near += other.near;
    swapped += other.swapped;
  }
};

Agreement Compare(const Detections2d& found, const Detections2d& reference) {
  using enum JointId;
  Agreement agreement;
  for (size_t f = 0; f < found.frames.size(); ++f) {
    const auto pixel = [f](const Detections2d& detections, JointId joint) {
      return Eigen::Vector2d(detections.frames[f].pixels.col(FindColumn(detections.joints, joint)));
    };
    const Eigen::Vector2d hips = (pixel(reference, kLeftHip) + pixel(reference, kRightHip)) / 2;
    const Eigen::Vector2d shoulders =
        (pixel(reference, kLeftShoulder) + pixel(reference, kRightShoulder)) / 2;
    const double torso = (shoulders - hips).norm();
    for (const JointId joint : ScoredJoints14()) {
      if (reference.frames[f].confidence[FindColumn(reference.joints, joint)] < 0.4) continue;
      const double error = (pixel(found, joint) - pixel(reference, joint)).norm();
      const double to_other = (pixel(found, joint) - pixel(reference, MirrorJoint(joint))).norm();
      ++agreement.all;
      agreement.near += error < 0.1 * torso ? 1 : 0;
      agreement.swapped += error > 0.2 * torso && to_other < 0.1 * torso ? 1 : 0;
    }
  }
  return agreement;
}

// The true joints in the picture, where OpenPose is as sure as it must be to be compared with.
Detections2d TrueJoints(const JointTrack& truth, const Camera& camera,
                        const Detections2d& openpose) {
  Detections2d projected = openpose;
  for (size_t f = 0; f < projected.frames.size(); ++f) {
    for (size_t j = 0; j < openpose.joints.size(); ++j) {
      const int i = FindColumn(truth.joints, openpose.joints[j]);
      const auto column = static_cast<Eigen::Index>(j);
      Eigen::Vector2d pixel;
      if (i >= 0 && Project(camera,
                            camera.camera_from_world * Eigen::Vector3d(truth.positions.block<3, 1>(
                                                           3 * i, static_cast<Eigen::Index>(f))),
                            &pixel)) {
        projected.frames[f].pixels.col(column) = pixel;
      } else {
        projected.frames[f].confidence[column] = 0;
      }
    }
  }
  return projected;
}

// From the videos alone, of the man and not of the onlooker, with the looks that are chosen for 60
// frames per second. The truth was triangulated from OpenPose's joints in four views, and still ours
// lie near it as often as OpenPose's.
TEST(DetectClipDataTest, JointsAgreeWithOpenPosesAndTheTruth) {
  MPC_REQUIRE_DATA();
  MPC_REQUIRE_MODELS();
  Agreement both, to_truth, of_openpose;
  const JointTrack truth = ReadJointTrack(*testing::DataDir() / "pose2sim" / "gt_joints.json");
  for (const std::string name : {"cam01", "cam03"}) {
    const std::filesystem::path folder = *testing::DataDir() / "pose2sim";
    VideoReader video(folder / (name + ".mp4"));
    ClipDetector detector(FindPoseModels(), video.width(), video.height(), video.fps());
    cv::Mat picture;
    for (int f = 0; f < 25 && video.Read(&picture); ++f) detector.Add(picture);
    const ClipDetections found = detector.Finish();
    EXPECT_EQ(found.every, 6);
    EXPECT_GE(found.num_looks, 5);
    EXPECT_LE(found.num_looks, 9);
    EXPECT_EQ(found.num_seen, found.num_looks);
    ASSERT_EQ(found.detections2d.frames.size(), 25u);
    found.detections2d.Validate();
    found.detections3d.Validate();
    Detections2d openpose = ReadDetections2d(folder / (name + "_openpose_body25b.json"));
    openpose.frames.resize(found.detections2d.frames.size());
    const Camera camera = ReadCamera((folder / "cameras.json").string() + ":" + name);
    const Detections2d true_joints = TrueJoints(truth, camera, openpose);
    const Agreement one = Compare(found.detections2d, openpose);
    const Agreement ours = Compare(found.detections2d, true_joints);
    const Agreement theirs = Compare(openpose, true_joints);
    std::printf(
        "%s: %.1f %% of %d joints within a tenth of the torso of OpenPose's; of the truth: ours "
        "%.1f %%, OpenPose's %.1f %%\n",
        name.c_str(), one.percent(), one.all, ours.percent(), theirs.percent());
    both += one;
    to_truth += ours;
    of_openpose += theirs;
  }
  EXPECT_GE(both.percent(), 90);
  EXPECT_EQ(both.swapped, 0);
  EXPECT_GE(to_truth.percent(), of_openpose.percent() - 1);
}

// Pictures of the man, moved within a wider one.
class TrackerDataTest : public ::testing::Test {
 protected:
  static PoseTracker Tracker(double fps) {
    const PoseModels models = FindPoseModels();
    return {PersonDetector(Network::Read(models.detector)),
            PoseLandmarker(Network::Read(models.landmarker)), fps};
  }
  static cv::Mat Canvas() { return {500, 1000, CV_8UC3, cv::Scalar::all(110)}; }
};

TEST_F(TrackerDataTest, ThePersonKeepsTheNumberThroughAJump) {
  MPC_REQUIRE_DATA();
  MPC_REQUIRE_MODELS();
  const cv::Mat man = testing::ManPicture("cam01");
  PoseTracker tracker = Tracker(30);
  std::vector<PersonPose> poses;
  for (const int x : {100, 104, 340}) {  // the last step is half of the region
    cv::Mat picture = Canvas();
    man.copyTo(picture(cv::Rect(x, 0, man.cols, man.rows)));
    const std::vector<TrackedPerson> persons =
        tracker.Next(picture, static_cast<int>(poses.size()));
    const auto same = std::find_if(persons.begin(), persons.end(),
                                   [](const TrackedPerson& person) { return person.id == 0; });
    ASSERT_NE(same, persons.end()) << "at " << x;
    poses.push_back(same->pose);
  }
  const Eigen::Vector2d step = (poses[2].pixels - poses[1].pixels).rowwise().mean();
  EXPECT_NEAR(step.x(), 236, 6);
  EXPECT_NEAR(step.y(), 0, 6);
}

TEST_F(TrackerDataTest, WhoIsLostDoesNotTakeAnother) {
  MPC_REQUIRE_DATA();
  MPC_REQUIRE_MODELS();
  const cv::Mat left = testing::ManPicture("cam01"), right = testing::ManPicture("cam03");
  PoseTracker tracker = Tracker(30);
  std::vector<int> left_ids, right_ids;
  for (int f = 0; f < 4; ++f) {
    cv::Mat picture = Canvas();
    left.copyTo(picture(cv::Rect(50, 0, left.cols, left.rows)));
    const bool hidden = f == 1 || f == 2;
    if (!hidden) right.copyTo(picture(cv::Rect(550, 0, right.cols, right.rows)));
    for (const TrackedPerson& person : tracker.Next(picture, f)) {
      const bool is_left = person.pose.refined.center.x() < 500;
      if (person.pose.refined.size_px > 250) (is_left ? left_ids : right_ids).push_back(person.id);
    }
  }
  ASSERT_EQ(left_ids.size(), 4u);
  ASSERT_EQ(right_ids.size(), 2u);
  EXPECT_NE(left_ids[0], right_ids[0]);
  EXPECT_EQ(left_ids, std::vector<int>(4, left_ids[0]));
  EXPECT_EQ(right_ids, std::vector<int>(2, right_ids[0]));
}

}  // namespace
}  // namespace mpc
