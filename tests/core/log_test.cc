#include "mpc/core/log.h"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "mpc/core/thread_pool.h"

namespace mpc {
namespace {

class LogTest : public ::testing::Test {
 protected:
  ~LogTest() override { SetLogSink(nullptr); }
};

TEST_F(LogTest, SinkReceivesLevelAndMessage) {
  std::vector<std::pair<LogLevel, std::string>> lines;
  SetLogSink([&](LogLevel level, std::string_view message) { lines.emplace_back(level, message); });
  LogInfo("one");
  LogWarning("two");
  Log(LogLevel::kDebug, "three");
  const std::vector<std::pair<LogLevel, std::string>> expected = {
      {LogLevel::kInfo, "one"}, {LogLevel::kWarning, "two"}, {LogLevel::kDebug, "three"}};
  EXPECT_EQ(lines, expected);
}

TEST_F(LogTest, DefaultWritesWarningsOnlyToStderr) {
  ::testing::internal::CaptureStderr();
  LogInfo("quiet");
  LogWarning("loud");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "mpc: loud\n");
}

TEST_F(LogTest, SinkIsCalledByOneThreadAtATime) {
  int calls = 0;  // unprotected on purpose: the log's own lock is what is tested
  SetLogSink([&](LogLevel, std::string_view) {
    const int before = calls;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    calls = before + 1;
  });
  ParallelFor(40, 4, [](int) { LogInfo("message"); });
  EXPECT_EQ(calls, 40);
}

}  // namespace
}  // namespace mpc
