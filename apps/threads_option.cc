#include "threads_option.h"

#include <opencv2/core.hpp>

namespace monoperfcap {

void AddThreadsOption(CLI::App* app, int* num_threads) {
  const auto use = [num_threads](int given) {
    *num_threads = given;
    if (given > 0) cv::setNumThreads(given);
  };
  app->add_option_function<int>("--threads", use, "Threads; 0: all cores")
      ->check(CLI::Range(0, 1024));
}

}  // namespace monoperfcap
