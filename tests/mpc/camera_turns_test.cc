#include "camera_turns.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "io/temp_dir.h"
#include "mpc/core/units.h"

namespace mpc::internal {
namespace {

using testing::TempDir;

constexpr int kWidth = 480, kHeight = 360;

Camera TestCamera() { return Camera::FromFov(kWidth, kHeight, 50 * kDegree); }

Eigen::Matrix3d Turn(double yaw_deg, double pitch_deg) {
  return (Eigen::AngleAxisd(pitch_deg * kDegree, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(yaw_deg * kDegree, Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

cv::Matx33d HomographyOf(const Eigen::Matrix3d& turn) {
  cv::Matx33d homography;
  cv::eigen2cv(HomographyOfTurn(turn, TestCamera()), homography);
  return homography;
}

TEST(CameraTurns, HomographiesShowWhatATurnedCameraSees) {
  const Eigen::Matrix3d turn = Turn(7, -3);
  const Eigen::Vector3d x(0.3, -0.2, 2);
  Eigen::Vector2d before, after;
  ASSERT_TRUE(Project(TestCamera(), x, &before));
  ASSERT_TRUE(Project(TestCamera(), turn * x, &after));
  const Eigen::Vector3d seen = HomographyOfTurn(turn, TestCamera()) * before.homogeneous();
  EXPECT_LT((seen.hnormalized() - after).norm(), 1e-9);
}

// What a camera sees of a wall, a person in front of it who walks to the right from frame to frame, and
// where that person was detected.
struct Scene {
  Scene() {
    wall.create(3 * kHeight, 3 * kWidth, CV_8UC3);
    cv::RNG(5).fill(wall, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(wall, wall, {}, 3);
    cv::normalize(wall, wall, 20, 235, cv::NORM_MINMAX);
  }

  cv::Mat Picture(const Eigen::Matrix3d& turn, int frame) {
    const cv::Matx33d shift(1, 0, -kWidth, 0, 1, -kHeight, 0, 0, 1);
    cv::Mat picture;
    cv::warpPerspective(wall, picture, HomographyOf(turn) * shift, {kWidth, kHeight});
    const cv::Rect person(120 + 4 * frame, 80, 60, 220);
    cv::RNG rng(frame);
    rng.fill(picture(person), cv::RNG::UNIFORM, 0, 256);
    Detections2d::Frame detected;
    detected.pixels.resize(2, 3);
    detected.pixels << person.x, person.br().x, 9, person.y, person.br().y, 9;
    detected.confidence = Eigen::Vector3d(1, 0.8, 0);
    detections.frames.push_back(detected);
    return picture;
  }

  cv::Mat wall;
  Detections2d detections;
};

TEST(CameraTurns, TurnOfAHomography) {
  const Eigen::Matrix3d truth = Turn(7, -3);
  const auto turn = TurnOfHomography(HomographyOf(truth), TestCamera());
  ASSERT_TRUE(turn);
  EXPECT_LT((*turn - truth).norm(), 1e-9);
  // A zoom, a mirror and a camera that looks behind itself are none.
  EXPECT_FALSE(TurnOfHomography(cv::Matx33d(1.2, 0, -48, 0, 1.2, -36, 0, 0, 1), TestCamera()));
  EXPECT_FALSE(TurnOfHomography(cv::Matx33d(-1, 0, kWidth, 0, 1, 0, 0, 0, 1), TestCamera()));
  EXPECT_FALSE(TurnOfHomography(HomographyOf(Turn(120, 0)), TestCamera()));
}

TEST(CameraTurns, PersonBoxIsAroundWhatWasDetected) {
  Scene scene;
  scene.Picture(Turn(0, 0), 0);
  const cv::Mat box = PersonBox(scene.detections.frames[0], {kWidth, kHeight});
  EXPECT_EQ(cv::boundingRect(box), cv::Rect(87, 47, 126, 286));
  EXPECT_EQ(cv::countNonZero(PersonBox({}, {kWidth, kHeight})), 0);
  Detections2d::Frame outside = scene.detections.frames[0];
  outside.pixels.array() += 5000;
  EXPECT_EQ(cv::countNonZero(PersonBox(outside, {kWidth, kHeight})), 0);
}

TEST(CameraTurns, ACameraRestsUnlessTheBackgroundSaysOtherwise) {
  Scene scene;
  std::vector<cv::Mat> still, turning;
  std::vector<int> frames;
  for (int f = 0; f < 6; ++f) {
    still.push_back(scene.Picture(Turn(0, 0), f));
    frames.push_back(f);
  }
  for (int f = 0; f < 6; ++f) turning.push_back(scene.Picture(Turn(0.5 * f, 0), f));
  EXPECT_TRUE(CameraRests(still, frames, scene.detections));
  EXPECT_FALSE(CameraRests(turning, frames, scene.detections));
  turning = still;
  for (cv::Mat& picture : turning) picture.setTo(90);  // nothing to see
  EXPECT_FALSE(CameraRests(turning, frames, scene.detections));
  EXPECT_TRUE(CameraRests({}, {}, scene.detections));
  EXPECT_TRUE(CameraRests(std::span(still).first(1), std::span(frames).first(1), scene.detections));
}

TEST(CameraTurns, FollowsAPanAndAShake) {
  const TempDir folder;
  Scene scene;
  VideoWriter writer(folder / "turns.mp4", kWidth, kHeight, 30);
  std::vector<Eigen::Matrix3d> truth;
  constexpr int kFrames = 30;
  for (int f = 0; f < kFrames; ++f) {
    truth.push_back(Turn(0.6 * f, 0.5 * std::sin(0.7 * f)));
    writer.Write(scene.Picture(truth.back(), f));
  }
  writer.Close();
  int steps = 0;
  const auto turning = FollowCamera(VideoReader(folder / "turns.mp4"), TestCamera(),
                                    scene.detections, [&](const Progress& progress) {
                                      ++steps;
                                      return progress.step <= kFrames;
                                    });
  ASSERT_TRUE(turning);
  EXPECT_EQ(steps, kFrames);
  EXPECT_EQ(turning->num_unseen, 0);
  EXPECT_NEAR(turning->largest_rad, 17.4 * kDegree, 0.1 * kDegree);
  ASSERT_EQ(turning->places.size(), truth.size());
  for (size_t f = 0; f < truth.size(); ++f) {
    const Eigen::Matrix3d error = turning->places[f].rotation * truth[f].transpose();
    EXPECT_LT(Eigen::AngleAxisd(error).angle(), 0.1 * kDegree) << f;
    EXPECT_TRUE(turning->places[f].translation.isZero());
  }
  EXPECT_FALSE(FollowCamera(VideoReader(folder / "turns.mp4"), TestCamera(), scene.detections,
                            [](const Progress& progress) { return progress.step < 3; }));
}

TEST(CameraTurns, FramesThatShowNothingKeepTheTurnBefore) {
  const TempDir folder;
  Scene scene;
  VideoWriter writer(folder / "turns.mp4", kWidth, kHeight, 30);
  for (int f = 0; f < 6; ++f) {
    cv::Mat picture = scene.Picture(Turn(f, 0), f);
    if (f == 3) picture.setTo(0);
    writer.Write(picture);
  }
  writer.Close();
  const auto turning =
      FollowCamera(VideoReader(folder / "turns.mp4"), TestCamera(), scene.detections, {});
  ASSERT_TRUE(turning);
  EXPECT_GE(turning->num_unseen, 1);
  EXPECT_EQ(turning->places[3].rotation, turning->places[2].rotation);
}

}  // namespace
}  // namespace mpc::internal
