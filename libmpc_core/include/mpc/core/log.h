// Purpose: where the libraries' warnings go. No library writes to a stream itself.
//
// By default messages of level kWarning and above go to stderr, one line each. A program may
// install its own sink; the sink may be called from several threads, one call at a time.
#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace mpc {

enum class LogLevel { kDebug, kInfo, kWarning };

using LogSink = std::function<void(LogLevel level, std::string_view message)>;

// Replaces the sink for the whole process; an empty sink restores the default.
void SetLogSink(LogSink sink);

void Log(LogLevel level, std::string_view message);
inline void LogInfo(std::string_view message) { Log(LogLevel::kInfo, message); }
inline void LogWarning(std::string_view message) { Log(LogLevel::kWarning, message); }

}  // namespace mpc
