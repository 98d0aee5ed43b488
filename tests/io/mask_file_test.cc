#include "mpc/io/mask_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "io/temp_dir.h"
#include "mpc/io/atomic_file.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

// A body of an ellipse with thin limbs that moves, and one frame with nobody.
std::vector<cv::Mat> MovingMasks(int width, int height, int num_frames) {
  std::vector<cv::Mat> masks;
  for (int f = 0; f < num_frames; ++f) {
    cv::Mat mask = cv::Mat::zeros(height, width, CV_8UC1);
    if (f != num_frames / 2) {
      const cv::Point center(width / 3 + 2 * f, height / 2);
      cv::ellipse(mask, center, {width / 8, height / 4}, 3 * f, 0, 360, 255, cv::FILLED);
      cv::line(mask, center, {width - 10 - 3 * f, 8 + f}, 255, 2);
      cv::line(mask, center, {width - 20, height - 9 - 2 * f}, 255, 5);
    }
    masks.push_back(mask);
  }
  return masks;
}

std::vector<cv::Mat> ReadAll(const fs::path& path, int width, int height) {
  MaskReader reader(path, width, height);
  std::vector<cv::Mat> masks;
  for (cv::Mat mask; reader.Read(&mask);) masks.push_back(mask.clone());
  return masks;
}

int NumDifferent(const cv::Mat& a, const cv::Mat& b) {
  EXPECT_EQ(a.size(), b.size());
  EXPECT_EQ(a.type(), b.type());
  return cv::countNonZero(a != b);
}

// H.264 as OpenCV makes it loses a pixel now and then, never more.
TEST(MaskFileTest, VideoKeepsMasksToAPixel) {
  const testing::TempDir dir;
  for (const auto& [width, height] : {std::pair(320, 240), std::pair(321, 239)}) {
    const std::vector<cv::Mat> masks = MovingMasks(width, height, 20);
    MaskVideoWriter writer(dir / "masks.mp4", width, height, 25);
    for (const cv::Mat& mask : masks) writer.Write(mask);
    writer.Close();
    const std::vector<cv::Mat> read = ReadAll(dir / "masks.mp4", width, height);
    ASSERT_EQ(read.size(), masks.size());
    for (size_t f = 0; f < masks.size(); ++f) EXPECT_LE(NumDifferent(read[f], masks[f]), 1) << f;
    EXPECT_EQ(cv::countNonZero(read[10]), 0);
  }
}

TEST(MaskFileTest, PicturesKeepMasksExactly) {
  const testing::TempDir dir;
  const std::vector<cv::Mat> masks = MovingMasks(121, 97, 12);
  MaskFolderWriter writer(dir / "masks");
  for (const cv::Mat& mask : masks) writer.Write(mask);
  writer.Close();
  EXPECT_TRUE(fs::exists(dir / "masks" / "000000.png"));
  EXPECT_TRUE(fs::exists(dir / "masks" / "000011.png"));
  const std::vector<cv::Mat> read = ReadAll(dir / "masks", 121, 97);
  ASSERT_EQ(read.size(), masks.size());
  for (size_t f = 0; f < masks.size(); ++f) EXPECT_EQ(NumDifferent(read[f], masks[f]), 0) << f;
}

TEST(MaskFileTest, AFolderHoldsOneRunOnly) {
  const testing::TempDir dir;
  const cv::Mat mask(8, 8, CV_8UC1, cv::Scalar(255));
  const auto write = [&](int count, bool close) {
    MaskFolderWriter writer(dir / "masks");
    for (int f = 0; f < count; ++f) writer.Write(mask);
    if (close) writer.Close();
  };
  write(5, /*close=*/true);
  write(3, /*close=*/true);
  EXPECT_EQ(ReadAll(dir / "masks", 8, 8).size(), 3u);
  dir.Write("masks/note.txt", "mine");
  write(2, /*close=*/false);  // stopped: nothing is left but what is not ours
  EXPECT_FALSE(fs::exists(dir / "masks" / "000000.png"));
  EXPECT_TRUE(fs::exists(dir / "masks" / "note.txt"));
}

// White, grey, ones, a colour on black: all mean inside.
TEST(MaskFileTest, PicturesOfOtherKindsAreUnderstood) {
  const testing::TempDir dir;
  fs::create_directory(dir / "masks");
  const cv::Rect inside(3, 2, 4, 5);
  const auto write = [&](const char* name, int type, const cv::Scalar& value) {
    cv::Mat picture = cv::Mat::zeros(10, 12, type);
    picture(inside) = value;
    cv::imwrite((dir / "masks" / name).string(), picture);
  };
  write("a.png", CV_8UC1, 255);
  write("b.png", CV_8UC1, 1);
  write("c.png", CV_8UC3, {0, 0, 128});
  write("d.png", CV_16UC1, 65535);
  write("e.png", CV_8UC1, 200);
  cv::Mat grey(10, 12, CV_8UC1, cv::Scalar(90));  // unsure, and outside where something is sure
  grey(inside) = 160;
  cv::imwrite((dir / "masks" / "f.png").string(), grey);
  const std::vector<cv::Mat> masks = ReadAll(dir / "masks", 12, 10);
  ASSERT_EQ(masks.size(), 6u);
  for (const cv::Mat& mask : masks) {
    EXPECT_EQ(cv::countNonZero(mask), inside.area());
    EXPECT_EQ(cv::countNonZero(mask(inside) == 255), inside.area());
  }
}

TEST(MaskFileTest, WhatIsWrongIsSaid) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(MaskReader(dir / "none", 8, 8), kFileNotFound, "none");
  fs::create_directory(dir / "empty");
  EXPECT_MPC_ERROR(MaskReader(dir / "empty", 8, 8), kBadFile, "no pictures");
  EXPECT_MPC_ERROR(MaskReader(dir.Write("bad.mp4", "no video"), 8, 8), kBadFile, "bad.mp4");

  const cv::Mat mask(8, 10, CV_8UC1, cv::Scalar(255));
  {
    MaskFolderWriter writer(dir / "masks");
    writer.Write(mask);
    writer.Write(mask);
    writer.Close();
  }
  EXPECT_MPC_ERROR(MaskReader(dir / "masks", 8, 10), kMismatch,
                   "has masks of 10 x 8, the clip is 8 x 10");
  // Only videos are padded.
  EXPECT_MPC_ERROR(MaskReader(dir / "masks", 9, 8), kMismatch, "10 x 8");
  std::ofstream(dir / "masks" / "000001.png") << "no picture";
  MaskReader reader(dir / "masks", 10, 8);
  cv::Mat read;
  EXPECT_TRUE(reader.Read(&read));
  EXPECT_MPC_ERROR(reader.Read(&read), kBadFile, "000001.png");

  dir.Write("file", "x");
  EXPECT_MPC_ERROR(MaskFolderWriter(dir / "file"), kWriteFailed, "not a folder");
  MaskVideoWriter video(dir / "masks.mp4", 10, 8, 25);
  EXPECT_MPC_ERROR(video.Write(cv::Mat(8, 10, CV_8UC3)), kInvalidArgument, "one channel");
}

}  // namespace
}  // namespace mpc
