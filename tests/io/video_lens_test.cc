#include "mpc/io/video_lens.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <numbers>
#include <string>

#include "io/run_program.h"
#include "io/temp_dir.h"

namespace mpc {
namespace {

const std::string kKey = "com.apple.quicktime.camera.focal_length.35mm_equivalent";

std::string Number(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 0xff);
  return text;
}

std::string Box(const std::string& type, const std::string& content) {
  return Number(content.size() + 8, 4) + type + content;
}

// A list of two keys, and the value of the second.
std::string Meta(const std::string& key, int kind, const std::string& value) {
  return Box(
      "meta",
      Box("hdlr", std::string(24, '\0')) +
          Box("keys", Number(0, 4) + Number(2, 4) + Box("mdta", "com.apple.quicktime.make") +
                          Box("mdta", key)) +
          Box("ilst", Box(Number(1, 4), Box("data", Number(1, 4) + Number(0, 4) + "Apple")) +
                          Box(Number(2, 4), Box("data", Number(kind, 4) + Number(0, 4) + value))));
}

std::string Movie(const std::string& index) {
  return Box("ftyp", "qt  ") + Box("mdat", std::string(1000, 'x')) +
         Box("moov", Box("mvhd", std::string(100, '\0')) + index);
}

std::string InTrack(const std::string& meta) {
  return Movie(Box("trak", Box("tkhd", std::string(84, '\0')) + meta));
}

class VideoLensTest : public ::testing::Test {
 protected:
  std::optional<double> Focal(const std::string& bytes) const {
    std::ofstream(folder_ / "clip.mov", std::ios::binary) << bytes;
    return ReadFocalLength35mm(folder_ / "clip.mov");
  }
  testing::TempDir folder_;
};

TEST_F(VideoLensTest, IsThatOfTheFileOrOfItsTrack) {
  const std::string meta = Meta(kKey, 21, Number(26, 4));
  EXPECT_EQ(Focal(Movie(meta)), 26);
  EXPECT_EQ(Focal(InTrack(meta)), 26);
  EXPECT_EQ(Focal(Movie(Box("trak", "") + Box("udta", meta))), 26);
}

TEST_F(VideoLensTest, TheBoxOfMp4StartsWithAVersion) {
  std::string meta = Meta(kKey, 21, Number(26, 4));
  meta = Box("meta", Number(0, 4) + meta.substr(8));
  EXPECT_EQ(Focal(Movie(meta)), 26);
}

TEST_F(VideoLensTest, EveryKindOfNumber) {
  const float as_float = 13.5F;
  const double as_double = 13.5;
  std::uint32_t float_bits = 0;
  std::uint64_t double_bits = 0;
  std::memcpy(&float_bits, &as_float, 4);
  std::memcpy(&double_bits, &as_double, 8);
  EXPECT_EQ(Focal(InTrack(Meta(kKey, 23, Number(float_bits, 4)))), 13.5);
  EXPECT_EQ(Focal(InTrack(Meta(kKey, 24, Number(double_bits, 8)))), 13.5);
  EXPECT_EQ(Focal(InTrack(Meta(kKey, 1, "13.50mm"))), 13.5);
  EXPECT_EQ(Focal(InTrack(Meta(kKey, 21, Number(77, 1)))), 77);
  EXPECT_EQ(Focal(InTrack(Meta(kKey, 22, Number(200, 1)))), 200);
  EXPECT_EQ(Focal(InTrack(Meta(kKey, 66, Number(120, 2)))), 120);
  EXPECT_EQ(Focal(InTrack(Meta(kKey, 77, Number(120, 4)))), 120);
}

TEST_F(VideoLensTest, WhatIsNoFocalLengthIsNone) {
  EXPECT_FALSE(Focal(InTrack(Meta("com.apple.quicktime.model", 21, Number(26, 4)))));
  EXPECT_FALSE(Focal(InTrack(Meta(kKey, 21, Number(0, 4)))));
  EXPECT_FALSE(Focal(InTrack(Meta(kKey, 21, Number(243, 1)))));         // -13
  EXPECT_FALSE(Focal(InTrack(Meta(kKey, 23, Number(0x7fc00000, 4)))));  // not a number
  EXPECT_FALSE(Focal(InTrack(Meta(kKey, 23, Number(26, 8)))));
  EXPECT_FALSE(Focal(InTrack(Meta(kKey, 1, "wide"))));
  EXPECT_FALSE(Focal(InTrack(Meta(kKey, 13, Number(26, 4)))));  // a picture
  EXPECT_FALSE(Focal("") || Focal("no video at all, but more than eight bytes"));
  EXPECT_FALSE(ReadFocalLength35mm(folder_.path()));
  EXPECT_FALSE(ReadFocalLength35mm(folder_ / "missing.mov"));
}

// Cut at any byte, and with any byte changed.
TEST_F(VideoLensTest, BrokenFilesAreNoHarm) {
  const std::string whole = Box("moov", Meta(kKey, 21, Number(26, 4)));
  for (size_t size = 0; size < whole.size(); ++size) EXPECT_FALSE(Focal(whole.substr(0, size)));
  for (size_t i = 0; i < whole.size(); ++i) {
    for (const int value : {0, 0xff}) {
      std::string changed = whole;
      changed[i] = static_cast<char>(value);
      const std::optional<double> focal = Focal(changed);
      EXPECT_TRUE(!focal || (*focal >= 4 && *focal <= 1000)) << i;
    }
  }
}

// A file as another program writes it.
TEST_F(VideoLensTest, ReadsWhatFfmpegWrites) {
  const std::string file = (folder_ / "made.mov").string();
  const testing::ProgramResult made = testing::RunProgram(
      "ffmpeg -f lavfi -i color=c=gray:s=64x64:d=0.1 -movflags use_metadata_tags -metadata " +
      kKey + "=27 " + file);
  ASSERT_EQ(made.status, 0) << made.output;
  EXPECT_EQ(ReadFocalLength35mm(file), 27);
}

// 26 mm: 67.3 degrees along the longer side of a photo.
TEST(FocalPxFrom35mm, FollowsTheLongerSide) {
  const double focal_px = FocalPxFrom35mm(26, 1920, 1080);
  EXPECT_EQ(FocalPxFrom35mm(26, 1080, 1920), focal_px);
  EXPECT_NEAR(2 * std::atan(960 / focal_px) * 180 / std::numbers::pi, 67.3, 0.1);
}

}  // namespace
}  // namespace mpc
