#include "mpc/core/thread_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace mpc {
namespace {

TEST(ParallelForTest, EveryIndexOnceWhateverTheNumberOfThreads) {
  for (const int num_threads : {-1, 0, 1, 2, 3, 8, 100}) {
    std::vector<int> calls(37, 0);
    ParallelFor(37, num_threads, [&](int i) { calls[static_cast<size_t>(i)] += i + 1; });
    for (int i = 0; i < 37; ++i) EXPECT_EQ(calls[static_cast<size_t>(i)], i + 1);
  }
}

TEST(ParallelForTest, NothingToDo) {
  ParallelFor(0, 4, [](int) { FAIL(); });
  ParallelFor(-3, 4, [](int) { FAIL(); });
}

TEST(ParallelForTest, RunsSideBySide) {
  // Two calls that wait for each other end only when they run at the same time.
  const int all_cores = ResolveNumThreads(0) > 1 ? 0 : 2;
  for (const int num_threads : {2, all_cores}) {
    std::atomic<int> arrived = 0;
    ParallelFor(2, num_threads, [&](int) {
      ++arrived;
      const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(10);
      while (arrived < 2 && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
      EXPECT_EQ(arrived, 2);
    });
  }
}

TEST(ParallelForTest, RethrowsTheLowestFailure) {
  for (const int num_threads : {1, 2, 4}) {
    for (const int slow : {10, 11}) {
      std::vector<int> finished(64, 0);
      std::atomic<bool> next_started = num_threads == 1;
      std::string caught;
      try {
        ParallelFor(64, num_threads, [&](int i) {
          // 10 and 11 fail side by side, one after the other in either order.
          if (i == 11) next_started = true;
          while (i == 10 && !next_started) std::this_thread::yield();
          if (i == slow) std::this_thread::sleep_for(std::chrono::milliseconds(20));
          if (i == 10 || i == 11 || i == 40) throw std::runtime_error(std::to_string(i));
          finished[static_cast<size_t>(i)] = 1;
        });
      } catch (const std::runtime_error& error) {
        caught = error.what();
      }
      EXPECT_EQ(caught, "10");
      for (size_t i = 0; i < 10; ++i) EXPECT_EQ(finished[i], 1);
    }
  }
}

TEST(ResolveNumThreadsTest, PositiveIsKeptAndTheRestMeansAllCores) {
  EXPECT_EQ(ResolveNumThreads(3), 3);
  EXPECT_GE(ResolveNumThreads(0), 1);
  EXPECT_EQ(ResolveNumThreads(-1), ResolveNumThreads(0));
}

}  // namespace
}  // namespace mpc
