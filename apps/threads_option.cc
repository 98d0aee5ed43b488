#include "threads_option.h"

#include <opencv2/core.hpp>

namespace monoperfcap {

void AddThreadsOption(CLI::App* app, int* num_threads) {
  app->add_option("--threads", *num_threads, "Threads; 0: all cores")
      ->check(CLI::Range(0, 1024))
      ->each([](const std::string& given) {
        if (const int threads = std::stoi(given); threads > 0) cv::setNumThreads(threads);
      });
}

}  // namespace monoperfcap
