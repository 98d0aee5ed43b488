// When the networks look, and what a clip gets between looks: pictures of a man, moved as a whole.
#include <gtest/gtest.h>

#include <functional>
#include <optional>

#include "man_picture.h"
#include "models_dir.h"
#include "mpc/detect/clip_detector.h"

namespace mpc {
namespace {

class ClipDataTest : public ::testing::Test {
 protected:
  // A clip at 60 frames per second of the man, moved to the right by shift_px of the frame; empty
  // where there is nobody.
  static ClipDetections Detect(int num_frames,
                               const std::function<std::optional<int>(int)>& shift_px,
                               ClipDetectorOptions options = {}) {
    const cv::Mat man = testing::ManPicture("cam01");
    ClipDetector detector(FindPoseModels(), kWidth, man.rows, 60, options);
    for (int f = 0; f < num_frames; ++f) {
      cv::Mat picture(man.rows, kWidth, CV_8UC3, cv::Scalar::all(110));
      if (const auto shift = shift_px(f)) {
        man.copyTo(picture(cv::Rect(*shift, 0, man.cols, man.rows)));
      }
      detector.Add(picture);
    }
    return detector.Finish();
  }
  // How far the man's joints have moved since the first frame.
  static double Shift(const ClipDetections& found, int frame) {
    const auto& frames = found.detections2d.frames;
    return (frames[static_cast<size_t>(frame)].pixels - frames[0].pixels).row(0).mean();
  }
  static bool IsSeen(const ClipDetections& found, int frame) {
    return found.detections2d.frames[static_cast<size_t>(frame)].confidence.maxCoeff() > 0.5;
  }
  static constexpr int kWidth = 600;
};

TEST_F(ClipDataTest, RarelyLooksAtWhoMovesEvenly) {
  MPC_REQUIRE_DATA();
  MPC_REQUIRE_MODELS();
  const ClipDetections found = Detect(20, [](int f) { return 2 * f; });
  EXPECT_EQ(found.every, 6);
  EXPECT_EQ(found.num_looks, 5);  // 0, 6, 12, 18, 19
  EXPECT_EQ(found.num_seen, 5);
  for (int f = 0; f < 20; ++f) EXPECT_NEAR(Shift(found, f), 2 * f, 2) << f;
}

// There and back between two looks, which show the man at his place: only the look after them tells
// that he moves, and only a look between them where he was.
TEST_F(ClipDataTest, LooksBetweenWhereTheMotionIsNotEven) {
  MPC_REQUIRE_DATA();
  MPC_REQUIRE_MODELS();
  const auto shift = [](int f) { return f <= 3 ? 10 * f : f <= 6 ? 60 - 10 * f : 10 * (f - 6); };
  const ClipDetections found = Detect(13, shift);
  EXPECT_EQ(found.num_looks, 5);  // 0, 6, 12 and 3, 9
  EXPECT_EQ(found.num_seen, 5);
  EXPECT_EQ(found.masks.size(), 5u);
  EXPECT_NEAR(Shift(found, 3), 30, 3);
  EXPECT_NEAR(Shift(found, 6), 0, 3);
  EXPECT_NEAR(Shift(found, 9), 30, 3);
  ClipDetectorOptions options;
  options.every = 6;
  const ClipDetections given = Detect(13, shift, options);
  EXPECT_EQ(given.num_looks, 3);
  EXPECT_LT(Shift(given, 3), 10);
}

// Where too few looks show whether the motion is even, another one is spent.
TEST_F(ClipDataTest, TakesClipsOfAFewFrames) {
  MPC_REQUIRE_DATA();
  MPC_REQUIRE_MODELS();
  for (const auto& [num_frames, num_looks] :
       {std::pair(1, 1), {2, 2}, {3, 2}, {4, 2}, {5, 3}, {7, 3}}) {
    const ClipDetections found = Detect(num_frames, [](int) { return 50; });
    EXPECT_EQ(found.num_looks, num_looks) << num_frames;
    EXPECT_EQ(found.num_seen, num_looks) << num_frames;
    for (int f = 0; f < num_frames; ++f) {
      EXPECT_TRUE(IsSeen(found, f)) << f << " of " << num_frames;
      EXPECT_NEAR(Shift(found, f), 0, 2) << f << " of " << num_frames;
    }
  }
}

// In a clip that is cut off between two looks: away, there, away, there.
TEST_F(ClipDataTest, InventsNobodyBetweenLooks) {
  MPC_REQUIRE_DATA();
  MPC_REQUIRE_MODELS();
  const ClipDetections found = Detect(29, [](int f) {
    const bool is_there = (f >= 5 && f < 13) || f >= 23;
    return is_there ? std::optional(60) : std::nullopt;
  });
  EXPECT_EQ(found.num_persons, 1);
  for (int f = 0; f < 29; ++f) {
    const bool is_seen = (f >= 6 && f <= 12) || f >= 24;  // looks: 6, 9, 12; 24, 27, 28
    EXPECT_EQ(IsSeen(found, f), is_seen) << f;
  }
  EXPECT_EQ(found.num_seen, 6);
  EXPECT_EQ(found.num_looks, 8);  // and 0, 18
}

}  // namespace
}  // namespace mpc
