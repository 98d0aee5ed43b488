#include "mpc/io/trc.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "io/temp_dir.h"
#include "mpc/io/atomic_file.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

MarkerTrajectories Example() {
  MarkerTrajectories trajectories;
  trajectories.names = {"pelvis", "left_toe", "head top"};
  trajectories.fps = 29.97;
  trajectories.positions = 3 * Eigen::MatrixXd::Random(9, 5);
  trajectories.positions.block<3, 1>(3, 2).setConstant(kNan);
  trajectories.positions.block<3, 1>(6, 4).setConstant(kNan);
  return trajectories;
}

TEST(TrcTest, RoundTripKeepsEveryMarkerAndGap) {
  const testing::TempDir dir;
  const MarkerTrajectories written = Example();
  WriteTrc(dir / "a.trc", written);
  const MarkerTrajectories read = ReadTrc(dir / "a.trc");
  EXPECT_EQ(read.names, written.names);
  EXPECT_DOUBLE_EQ(read.fps, written.fps);
  ASSERT_EQ(read.positions.rows(), 9);
  ASSERT_EQ(read.positions.cols(), 5);
  for (int i = 0; i < 45; ++i) {
    const double a = written.positions.reshaped()[i];
    const double b = read.positions.reshaped()[i];
    EXPECT_EQ(std::isnan(a), std::isnan(b));
    if (std::isnan(a)) continue;
    EXPECT_NEAR(a, b, 1e-6);
  }
}

TEST(TrcTest, ReadsOtherUnits) {
  const testing::TempDir dir;
  WriteTrc(dir / "a.trc", Example());
  const MarkerTrajectories metres = ReadTrc(dir / "a.trc");
  for (const auto& [unit, factor] : {std::pair("mm", 0.001), std::pair("cm", 0.01)}) {
    std::string text = ReadFile(dir / "a.trc");
    text.replace(text.find("\tm\t"), 3, std::string("\t") + unit + "\t");
    const MarkerTrajectories other = ReadTrc(dir.Write("b.trc", text));
    EXPECT_NEAR(other.positions(0, 0), factor * metres.positions(0, 0), 1e-12);
  }
}

TEST(TrcTest, NamesTheFaultInABrokenFile) {
  const testing::TempDir dir;
  WriteTrc(dir / "a.trc", Example());
  const std::string good = ReadFile(dir / "a.trc");
  const auto broken = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return dir.Write("b.trc", text);
  };
  EXPECT_MPC_ERROR(ReadTrc(dir / "missing.trc"), kFileNotFound, "missing.trc");
  EXPECT_MPC_ERROR(ReadTrc(dir.Write("b.trc", "")), kBadFile, "the file ends");
  EXPECT_MPC_ERROR(ReadTrc(broken("PathFileType", "x")), kBadFile, "not a TRC file");
  EXPECT_MPC_ERROR(ReadTrc(broken("\tm\t", "\tyard\t")), kBadFile, "yard");
  EXPECT_MPC_ERROR(ReadTrc(broken("\t5\t3\t", "\t6\t3\t")), kBadFile, "the header says 6");
  EXPECT_MPC_ERROR(ReadTrc(broken("\t5\t3\t", "\t5\t4\t")), kBadFile, "the header says 4");
  EXPECT_MPC_ERROR(ReadTrc(broken("29.97", "-1")), kBadFile, "data rate");
  EXPECT_MPC_ERROR(ReadTrc(broken("1\t0.000000\t", "1\t0.000000\tabc")), kBadFile, "b.trc:7");
  EXPECT_MPC_ERROR(ReadTrc(broken("1\t0.000000\t", "1\t0.000000\n")), kBadFile, "columns");
}

TEST(TrcTest, RefusesWhatCannotBeWritten) {
  const testing::TempDir dir;
  MarkerTrajectories bad = Example();
  bad.names.pop_back();
  EXPECT_MPC_ERROR(WriteTrc(dir / "a.trc", bad), kInvalidArgument, "9 rows");
  bad = Example();
  bad.names[1] = "a\tb";
  EXPECT_MPC_ERROR(WriteTrc(dir / "a.trc", bad), kInvalidArgument, "tab");
  bad = Example();
  bad.fps = 0;
  EXPECT_MPC_ERROR(WriteTrc(dir / "a.trc", bad), kInvalidArgument, "frames per second");
  EXPECT_MPC_ERROR(WriteTrc("/dev/full", Example()), kWriteFailed, "/dev/full");
}

}  // namespace
}  // namespace mpc
