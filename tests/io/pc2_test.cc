#include "mpc/io/pc2.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "io/temp_dir.h"
#include "mpc/io/atomic_file.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

std::vector<Eigen::Matrix3Xf> Frames() {
  std::vector<Eigen::Matrix3Xf> frames;
  for (int f = 0; f < 4; ++f) {
    Eigen::Matrix3Xf positions(3, 5);
    for (int i = 0; i < positions.size(); ++i) positions(i) = 0.25f * static_cast<float>(i - 3 * f);
    frames.push_back(positions);
  }
  return frames;
}

void WriteFrames(const std::filesystem::path& path) {
  Pc2Writer writer(path, 5);
  for (const Eigen::Matrix3Xf& positions : Frames()) writer.Write(positions);
  writer.Close();
}

void ReadAll(const std::filesystem::path& path) {
  Pc2Reader reader(path);
  Eigen::Matrix3Xf positions;
  for (int f = 0; f < reader.num_frames(); ++f) reader.Read(f, &positions);
}

TEST(Pc2Test, ReadsWhatWasWrittenInAnyOrder) {
  const testing::TempDir dir;
  WriteFrames(dir / "a.pc2");
  Pc2Reader reader(dir / "a.pc2");
  ASSERT_EQ(reader.num_frames(), 4);
  ASSERT_EQ(reader.num_vertices(), 5);
  for (const int f : {2, 0, 3, 1}) {
    Eigen::Matrix3Xf positions;
    reader.Read(f, &positions);
    EXPECT_EQ(positions, Frames()[static_cast<size_t>(f)]) << f;
  }
  Eigen::Matrix3Xf positions;
  EXPECT_MPC_ERROR(reader.Read(4, &positions), kInvalidArgument, "no frame 4");
}

TEST(Pc2Test, HeaderIsAsTheFormatSays) {
  const testing::TempDir dir;
  WriteFrames(dir / "a.pc2");
  const std::string bytes = ReadFile(dir / "a.pc2");
  const std::string expected("POINTCACHE2\0\1\0\0\0\5\0\0\0\0\0\0\0\0\0\x80\x3f\4\0\0\0", 32);
  EXPECT_EQ(bytes.substr(0, 32), expected);
  EXPECT_EQ(bytes.size(), 32u + 4 * 5 * 12);
}

TEST(Pc2Test, IsNotThereBeforeItIsClosed) {
  const testing::TempDir dir;
  {
    Pc2Writer writer(dir / "a.pc2", 5);
    writer.Write(Frames()[0]);
  }
  EXPECT_TRUE(std::filesystem::is_empty(dir / "."));
}

TEST(Pc2Test, RefusesWrongFrames) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(Pc2Writer(dir / "a.pc2", 0), kInvalidArgument, "0 vertices");
  Pc2Writer writer(dir / "a.pc2", 5);
  EXPECT_MPC_ERROR(writer.Write(Eigen::Matrix3Xf::Zero(3, 4)), kMismatch, "4 vertices, expected 5");
  Eigen::Matrix3Xf bad = Frames()[0];
  bad(2, 3) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_MPC_ERROR(writer.Write(bad), kInvalidArgument, "not finite");
}

TEST(Pc2Test, RefusesBadFiles) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(Pc2Reader(dir / "none.pc2"), kFileNotFound, "none.pc2");
  EXPECT_MPC_ERROR(Pc2Reader(dir / "."), kFileNotFound, "cannot be opened");
  WriteFrames(dir / "a.pc2");
  const std::string good = ReadFile(dir / "a.pc2");
  const auto expect_bad = [&](std::string bytes, const char* fault) {
    WriteFileAtomically(dir / "b.pc2", bytes);
    EXPECT_MPC_ERROR(ReadAll(dir / "b.pc2"), kBadFile, fault);
  };
  for (size_t size = 0; size < good.size(); ++size) {
    expect_bad(good.substr(0, size), size < 32 ? "no PC2" : "bytes, but");
  }
  expect_bad(good + "x", "bytes, but");
  std::string version = good;
  version[12] = 2;
  expect_bad(version, "version 2");
  std::string negative = good;
  negative[19] = '\x80';
  expect_bad(negative, "vertices and");
  std::string nan = good;
  nan.replace(40, 4, "\xff\xff\xff\xff");
  expect_bad(nan, "not finite");
}

}  // namespace
}  // namespace mpc
