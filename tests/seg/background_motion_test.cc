#include "mpc/seg/background_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/expect_error.h"
#include "test_scene.h"

namespace mpc {
namespace {

using mpc::testing::MakeScene;
using mpc::testing::TestScene;
using mpc::testing::TestSceneOptions;

cv::Vec2d Apply(const cv::Matx33d& h, const cv::Vec2d& p) {
  const cv::Vec3d q = h * cv::Vec3d(p[0], p[1], 1);
  return {q[0] / q[2], q[1] / q[2]};
}

TEST(BackgroundMotion, FindsAPanBehindAMovingActor) {
  for (const double scale : {1.0, 3.0}) {
    TestSceneOptions options;
    options.size = {cvRound(320 * scale), cvRound(240 * scale)};
    options.centre = {150 * scale, 120 * scale};
    options.height = 180 * scale;
    const TestScene before = MakeScene(options);
    options.camera = {7.25, -4.5};
    options.centre.x += 15 * scale;
    options.seed = 2;
    const TestScene now = MakeScene(options);
    const auto h = EstimateBackgroundMotion(before.picture, now.picture, now.truth);
    ASSERT_TRUE(h);
    for (const cv::Vec2d& p : {cv::Vec2d(10, 10), cv::Vec2d(300, 20), cv::Vec2d(160, 220)}) {
      EXPECT_LT(cv::norm(Apply(*h, p) - (p - cv::Vec2d(7.25, -4.5))), 0.4 * scale) << scale;
    }
  }
}

TEST(BackgroundMotion, FindsTurnAndZoomOfLargePictures) {
  TestSceneOptions options;
  options.size = {1440, 960};
  options.centre = {720, 480};
  options.height = 700;
  const TestScene before = MakeScene(options);
  const double c = 1.03 * std::cos(0.02), s = 1.03 * std::sin(0.02);
  const cv::Matx33d truth(c, -s, 6, s, c, -11, 0, 0, 1);  // previous from current
  cv::Mat now;
  cv::warpPerspective(before.picture, now, truth, options.size,
                      cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REFLECT);
  const auto h = EstimateBackgroundMotion(before.picture, now, {});
  ASSERT_TRUE(h);
  for (const cv::Vec2d& p : {cv::Vec2d(100, 100), cv::Vec2d(1300, 120), cv::Vec2d(700, 800)}) {
    EXPECT_LT(cv::norm(Apply(*h, p) - Apply(truth, p)), 0.8);
  }
}

TEST(BackgroundMotion, StillCameraIsExactlyTheIdentity) {
  TestSceneOptions options;
  const TestScene before = MakeScene(options);
  options.centre.x += 12;
  options.seed = 2;
  const TestScene now = MakeScene(options);
  const auto h = EstimateBackgroundMotion(before.picture, now.picture, now.truth);
  ASSERT_TRUE(h);
  EXPECT_EQ(*h, cv::Matx33d::eye());
}

TEST(BackgroundMotion, NothingToSeeIsNoMotion) {
  const cv::Mat plain(200, 300, CV_8UC3, cv::Scalar(90, 90, 90));
  EXPECT_FALSE(EstimateBackgroundMotion(plain, plain, {}));
  const TestScene scene = MakeScene();
  const cv::Mat everything(scene.picture.size(), CV_8U, cv::Scalar(255));
  EXPECT_FALSE(EstimateBackgroundMotion(scene.picture, scene.picture, everything));
  cv::Mat noise(scene.picture.size(), CV_8UC3);
  cv::RNG(3).fill(noise, cv::RNG::UNIFORM, 0, 256);
  EXPECT_FALSE(EstimateBackgroundMotion(noise, scene.picture, {}));
}

TEST(BackgroundMotion, TinyPictures) {
  for (const int side : {1, 2, 5, 17}) {
    const cv::Mat picture(side, side, CV_8U, cv::Scalar(50));
    EXPECT_FALSE(EstimateBackgroundMotion(picture, picture, {}));
  }
}

TEST(BackgroundMotion, RefusesOtherSizes) {
  const cv::Mat picture(20, 30, CV_8UC3, cv::Scalar::all(0));
  EXPECT_MPC_ERROR(EstimateBackgroundMotion(picture.t(), picture, {}), kMismatch, "size");
  EXPECT_MPC_ERROR(EstimateBackgroundMotion({}, picture, {}), kInvalidArgument, "empty");
}

}  // namespace
}  // namespace mpc
