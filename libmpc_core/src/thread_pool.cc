#include "mpc/core/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>
#include <vector>

namespace mpc {

int ResolveNumThreads(int requested) {
  if (requested > 0) return requested;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void ParallelFor(int n, int num_threads, const std::function<void(int)>& fn) {
  num_threads = std::min(ResolveNumThreads(num_threads), n);
  if (num_threads <= 1) {
    for (int i = 0; i < n; ++i) fn(i);
    return;
  }

  // Indices are claimed in order, so every index below a failed one runs to its end: the lowest
  // failure is the same whatever the number of threads.
  std::atomic<std::int64_t> next = 0;
  std::atomic<int> lowest_failure = std::numeric_limits<int>::max();
  std::mutex failure_mutex;
  std::exception_ptr failure;
  const auto work = [&] {
    for (;;) {
      const std::int64_t claimed = next.fetch_add(1);
      if (claimed >= n || claimed > lowest_failure) return;
      const int i = static_cast<int>(claimed);
      try {
        fn(i);
      } catch (...) {
        const std::lock_guard lock(failure_mutex);
        if (i < lowest_failure) {
          lowest_failure = i;
          failure = std::current_exception();
        }
      }
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int t = 1; t < num_threads; ++t) threads.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace mpc
