#include "mpc/core/log.h"

#include <cstdio>
#include <mutex>
#include <utility>

namespace mpc {
namespace {

void DefaultSink(LogLevel level, std::string_view message) {
  if (level < LogLevel::kWarning) return;
  std::fprintf(stderr, "mpc: %.*s\n", static_cast<int>(message.size()), message.data());
}

struct Logger {
  std::mutex mutex;
  LogSink sink = DefaultSink;
};

Logger& TheLogger() {
  static Logger logger;
  return logger;
}

}  // namespace

void SetLogSink(LogSink sink) {
  Logger& logger = TheLogger();
  const std::lock_guard lock(logger.mutex);
  logger.sink = sink ? std::move(sink) : DefaultSink;
}

void Log(LogLevel level, std::string_view message) {
  Logger& logger = TheLogger();
  const std::lock_guard lock(logger.mutex);
  logger.sink(level, message);
}

}  // namespace mpc
