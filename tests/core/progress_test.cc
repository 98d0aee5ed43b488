#include "mpc/core/progress.h"

#include <gtest/gtest.h>

namespace mpc {
namespace {

using std::chrono::seconds;

TEST(ProgressFormatterTest, EstimatesTheTimeLeftFromTheCurrentStage) {
  ProgressFormatter formatter;
  const ProgressFormatter::Clock::time_point start{};
  EXPECT_EQ(formatter.Line({"read", 0, 10}, start), "read 0/10 (0 %)");
  EXPECT_EQ(formatter.Line({"pose", 0, 100}, start + seconds(50)), "pose 0/100 (0 %)");
  EXPECT_EQ(formatter.Line({"pose", 40, 100}, start + seconds(52)), "pose 40/100 (40 %), 3 s left");
  EXPECT_EQ(formatter.Line({"pose", 100, 100}, start + seconds(55)), "pose 100/100 (100 %)");
}

TEST(ProgressFormatterTest, LongTimes) {
  ProgressFormatter formatter;
  const ProgressFormatter::Clock::time_point start{};
  formatter.Line({"pose", 0, 1000}, start);
  EXPECT_EQ(formatter.Line({"pose", 1, 1000}, start + seconds(1)),
            "pose 1/1000 (0 %), 16 min 39 s left");
  EXPECT_EQ(formatter.Line({"pose", 1, 1000}, start + seconds(10)),
            "pose 1/1000 (0 %), 2 h 46 min left");
}

TEST(ProgressFormatterTest, ResumedAndRestartedStages) {
  ProgressFormatter formatter;
  const ProgressFormatter::Clock::time_point start{};
  formatter.Line({"pose", 50, 100}, start);
  EXPECT_EQ(formatter.Line({"pose", 60, 100}, start + seconds(1)), "pose 60/100 (60 %), 4 s left");
  EXPECT_EQ(formatter.Line({"pose", 0, 100}, start + seconds(2)), "pose 0/100 (0 %)");
  EXPECT_EQ(formatter.Line({"pose", 50, 100}, start + seconds(7)), "pose 50/100 (50 %), 5 s left");
}

TEST(ProgressFormatterTest, UnknownLengthNamesTheStageOnly) {
  EXPECT_EQ(ProgressFormatter().Line({"write", 3, 0}), "write");
}

}  // namespace
}  // namespace mpc
