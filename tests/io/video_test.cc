// Video out and in again; the files a user may have by mistake. Needs ffmpeg's programs, as the
// demo does, to make rotated and variable-rate files and to look at codecs.
#include "mpc/io/video.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/run_program.h"
#include "io/temp_dir.h"
#include "mpc/io/atomic_file.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

// A picture whose left part is bright, with a bar that moves with the frame.
cv::Mat Picture(int width, int height, int frame) {
  cv::Mat picture(height, width, CV_8UC3, cv::Scalar(40, 40, 40));
  cv::rectangle(picture, cv::Rect(0, 0, width / 3, height), cv::Scalar(30, 200, 90), cv::FILLED);
  cv::rectangle(picture, cv::Rect(width / 2 + 4 * frame, height / 4, 8, height / 2),
                cv::Scalar(220, 220, 220), cv::FILLED);
  return picture;
}

void WriteClip(const fs::path& path, int width, int height, double fps, int num_frames) {
  VideoWriter writer(path, width, height, fps);
  for (int f = 0; f < num_frames; ++f) writer.Write(Picture(width, height, f));
  writer.Close();
}

std::string Output(const std::string& command) { return testing::RunProgram(command).output; }

bool HasFfmpeg() {
  return Output("ffmpeg -version").find("ffmpeg version") != std::string::npos &&
         Output("ffprobe -version").find("ffprobe version") != std::string::npos;
}

TEST(VideoTest, WhatIsWrittenIsRead) {
  const testing::TempDir dir;
  for (const auto& [width, height] : {std::pair(160, 120), std::pair(161, 119)}) {
    WriteClip(dir / "a.mp4", width, height, 29.97, 20);
    EXPECT_EQ(std::distance(fs::directory_iterator(dir.path()), fs::directory_iterator()), 1);
    VideoReader reader(dir / "a.mp4");
    EXPECT_EQ(reader.width(), (width + 1) / 2 * 2);
    EXPECT_EQ(reader.height(), (height + 1) / 2 * 2);
    EXPECT_NEAR(reader.fps(), 29.97, 1e-6);
    EXPECT_EQ(reader.num_frames(), 20);
    cv::Mat frame;
    for (int f = 0; f < 20; ++f) {
      ASSERT_TRUE(reader.Read(&frame)) << f;
      EXPECT_EQ(reader.frame_index(), f);
      EXPECT_NEAR(reader.frame_time_s(), f / 29.97, 1e-3);
      const cv::Rect inside(0, 0, width, height);
      EXPECT_LT(
          cv::norm(frame(inside), Picture(width, height, f), cv::NORM_L1) / (3 * inside.area()), 6)
          << f;
    }
    EXPECT_FALSE(reader.Read(&frame));
    EXPECT_FALSE(reader.Read(&frame));
  }
}

TEST(VideoTest, FramesPassedOverCount) {
  const testing::TempDir dir;
  WriteClip(dir / "a.mp4", 160, 120, 25, 20);
  VideoReader all(dir / "a.mp4"), some(dir / "a.mp4");
  cv::Mat expected, frame;
  for (int f = 0; f < 20; ++f) {
    ASSERT_TRUE(all.Read(&expected));
    if (f % 3 != 1) {
      ASSERT_TRUE(some.Skip());
    } else {
      ASSERT_TRUE(some.Read(&frame));
      EXPECT_EQ(cv::norm(frame, expected, cv::NORM_INF), 0) << f;
    }
    EXPECT_EQ(some.frame_index(), f);
    EXPECT_EQ(some.frame_time_s(), all.frame_time_s());
  }
  EXPECT_FALSE(some.Skip());
}

// Stripes of a hue across and down; where they come back, by their phase.
TEST(VideoTest, ColoursLieWhereTheyWere) {
  constexpr int kSide = 160;
  constexpr double kPeriod = 16;
  const testing::TempDir dir;
  for (const bool down : {false, true}) {
    cv::Mat stripes(kSide, kSide, CV_8UC3);
    const auto phase_at = [&](int x, int y) { return 2 * CV_PI * (down ? y : x) / kPeriod; };
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const double wave = 60 * std::sin(phase_at(x, y));
        stripes.at<cv::Vec3b>(y, x) = {cv::saturate_cast<uchar>(128 + wave), 128,
                                       cv::saturate_cast<uchar>(128 - 0.114 / 0.299 * wave)};
      }
    }
    VideoWriter writer(dir / "a.mp4", kSide, kSide, 25);
    writer.Write(stripes);
    writer.Close();
    cv::Mat read;
    ASSERT_TRUE(VideoReader(dir / "a.mp4").Read(&read));
    double sine = 0, cosine = 0;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const double blue = read.at<cv::Vec3b>(y, x)[0] - 128.0;
        sine += blue * std::sin(phase_at(x, y));
        cosine += blue * std::cos(phase_at(x, y));
      }
    }
    EXPECT_NEAR(2 * std::hypot(sine, cosine) / (kSide * kSide), 60, 6) << down;
    EXPECT_NEAR(std::atan2(cosine, sine) * kPeriod / (2 * CV_PI), 0, 0.05) << down;  // px
  }
}

TEST(VideoTest, GreyStaysGrey) {
  const testing::TempDir dir;
  cv::Mat grey(48, 64, CV_8UC1, cv::Scalar(0));
  grey.colRange(0, 20).setTo(255);
  grey.colRange(40, 64).setTo(128);
  VideoWriter writer(dir / "a.mp4", 64, 48, 25);
  for (int f = 0; f < 5; ++f) writer.Write(grey);
  writer.Close();
  cv::Mat frame;
  ASSERT_TRUE(VideoReader(dir / "a.mp4").Read(&frame));
  for (const auto& [x, value] : {std::pair(10, 255), std::pair(30, 0), std::pair(50, 128)}) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(frame.at<cv::Vec3b>(24, x)[c], value, 3) << x;
  }
}

TEST(VideoTest, FormatPlaysEverywhere) {
  if (!HasFfmpeg()) GTEST_SKIP() << "needs ffmpeg and ffprobe";
  const testing::TempDir dir;
  WriteClip(dir / "a.mp4", 160, 120, 25, 5);
  const std::string info = Output("ffprobe -v error -show_streams " + (dir / "a.mp4").string());
  EXPECT_THAT(info, ::testing::HasSubstr("codec_name=h264"));
  EXPECT_THAT(info, ::testing::HasSubstr("pix_fmt=yuv420p\n"));
  EXPECT_THAT(info, ::testing::HasSubstr("nb_frames=5"));
}

TEST(VideoTest, RotationMetadataIsHonoured) {
  if (!HasFfmpeg()) GTEST_SKIP() << "needs ffmpeg and ffprobe";
  const testing::TempDir dir;
  WriteClip(dir / "a.mp4", 160, 120, 25, 5);
  Output("ffmpeg -i " + (dir / "a.mp4").string() + " -c copy -metadata:s:v rotate=90 " +
         (dir / "r.mp4").string());
  VideoReader reader(dir / "r.mp4");
  EXPECT_EQ(reader.width(), 120);
  EXPECT_EQ(reader.height(), 160);
  cv::Mat frame;
  ASSERT_TRUE(reader.Read(&frame));
  // The bright left part is now on one of the short sides, all across.
  const cv::Mat top = frame(cv::Rect(0, 0, 120, 40));
  const cv::Mat bottom = frame(cv::Rect(0, 120, 120, 40));
  EXPECT_GT(std::abs(cv::mean(top)[1] - cv::mean(bottom)[1]), 100);
}

TEST(VideoTest, VariableFrameRateIsRefused) {
  if (!HasFfmpeg()) GTEST_SKIP() << "needs ffmpeg and ffprobe";
  const testing::TempDir dir;
  WriteClip(dir / "a.mp4", 160, 120, 30, 30);
  Output("ffmpeg -i " + (dir / "a.mp4").string() +
         " -vf \"select='not(eq(mod(n,7),3))'\" -vsync vfr " + (dir / "v.mp4").string());
  VideoReader reader(dir / "v.mp4");
  cv::Mat frame;
  const auto read_all = [&] {
    while (reader.Read(&frame)) {
    }
  };
  EXPECT_MPC_ERROR(read_all(), kUnsupported, "variable frame rate: frame 3");
}

TEST(VideoTest, BrokenFilesAreRefused) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(VideoReader(dir / "no.mp4"), kFileNotFound, "no.mp4");
  EXPECT_MPC_ERROR(VideoReader(dir.Write("a.mp4", "")), kBadFile, "a.mp4");
  EXPECT_MPC_ERROR(VideoReader(dir.Write("a.mp4", std::string(5000, 'x'))), kBadFile, "a.mp4");
  WriteClip(dir / "a.mp4", 160, 120, 25, 60);
  const std::string good = ReadFile(dir / "a.mp4");
  EXPECT_MPC_ERROR(VideoReader(dir.Write("b.mp4", good.substr(0, good.size() / 2))), kBadFile,
                   "b.mp4");
}

// With the index in front, a file that was cut can still be opened.
TEST(VideoTest, CutFilesAreRefused) {
  if (!HasFfmpeg()) GTEST_SKIP() << "needs ffmpeg and ffprobe";
  const testing::TempDir dir;
  WriteClip(dir / "a.mp4", 160, 120, 25, 60);
  Output("ffmpeg -i " + (dir / "a.mp4").string() + " -c copy -movflags faststart " +
         (dir / "f.mp4").string());
  const std::string good = ReadFile(dir / "f.mp4");
  const auto path = dir.Write("cut.mp4", good.substr(0, good.size() * 2 / 3));
  const auto read_all = [&] {
    VideoReader reader(path);
    cv::Mat frame;
    while (reader.Read(&frame)) {
    }
  };
  EXPECT_MPC_ERROR(read_all(), kBadFile, "cut.mp4");
}

TEST(VideoTest, ReadsAFolderOfPictures) {
  const testing::TempDir dir;
  for (int f = 0; f < 4; ++f) {
    cv::imwrite((dir / ("frame_" + std::to_string(10 + f) + ".png")).string(), Picture(40, 30, f));
  }
  dir.Write("notes.txt", "not a picture");
  EXPECT_MPC_ERROR(VideoReader(dir.path()), kInvalidArgument, "frame rate");
  VideoReader reader(dir.path(), 10);
  EXPECT_EQ(reader.num_frames(), 4);
  cv::Mat frame;
  for (int f = 0; f < 4; ++f) {
    ASSERT_TRUE(reader.Read(&frame));
    EXPECT_NEAR(reader.frame_time_s(), 0.1 * f, 1e-12);
    EXPECT_EQ(cv::norm(frame, Picture(40, 30, f), cv::NORM_INF), 0);
  }
  EXPECT_FALSE(reader.Read(&frame));
  cv::imwrite((dir / "frame_11.png").string(), Picture(50, 30, 1));
  VideoReader mixed(dir.path(), 10);
  mixed.Read(&frame);
  EXPECT_MPC_ERROR(mixed.Read(&frame), kBadFile, "frame 1 is 50 x 30");
}

TEST(VideoTest, WritingReportsFailures) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(VideoWriter(dir / "no/a.mp4", 64, 48, 25), kWriteFailed, "no folder");
  EXPECT_MPC_ERROR(VideoWriter("/dev/full", 64, 48, 25), kWriteFailed, "/dev/full");
  EXPECT_MPC_ERROR(VideoWriter(dir / "a.mp4", 0, 48, 25), kInvalidArgument, "0 x 48");
  EXPECT_MPC_ERROR(VideoWriter(dir / "a.mp4", 64, 48, 0), kInvalidArgument, "0 frames");
  {
    VideoWriter writer(dir / "a.mp4", 64, 48, 25);
    EXPECT_MPC_ERROR(writer.Write(Picture(66, 48, 0)), kInvalidArgument, "66 x 48");
    EXPECT_MPC_ERROR(writer.Close(), kWriteFailed, "no frame");
  }
  {
    VideoWriter abandoned(dir / "a.mp4", 64, 48, 25);
    abandoned.Write(Picture(64, 48, 0));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(dir.path()), fs::directory_iterator()), 0);
}

// 30 frames of noise.
void WriteNoise(const fs::path& path) {
  VideoWriter writer(path, 320, 240, 25, VideoEffort::kLow);
  cv::RNG rng(1);
  cv::Mat noise(240, 320, CV_8UC3);
  for (int f = 0; f < 30; ++f) {
    rng.fill(noise, cv::RNG::UNIFORM, 0, 255);
    writer.Write(noise);
  }
  writer.Close();
}

// In a child process that may write so many bytes per file.
int WriteNoiseWithin(size_t bytes, const fs::path& path) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit = {bytes, bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    int code = 0;
    try {
      WriteNoise(path);
    } catch (const Error& error) {
      code = error.code() == ErrorCode::kWriteFailed ? 1 : 2;
    }
    ::_exit(code);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  return WEXITSTATUS(status);
}

TEST(VideoTest, AFullDiskIsReported) {
  const testing::TempDir dir;
  WriteNoise(dir / "whole.mp4");
  const size_t size = fs::file_size(dir / "whole.mp4");
  for (const size_t bytes : {size_t{20000}, size / 2, size - 3000, size - 1}) {
    EXPECT_EQ(WriteNoiseWithin(bytes, dir / "a.mp4"), 1) << bytes << " of " << size;
    EXPECT_FALSE(fs::exists(dir / "a.mp4"));
  }
  EXPECT_EQ(WriteNoiseWithin(size, dir / "a.mp4"), 0);
  EXPECT_TRUE(fs::exists(dir / "a.mp4"));
}

}  // namespace
}  // namespace mpc
