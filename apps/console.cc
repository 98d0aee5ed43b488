#include "console.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>

namespace monoperfcap {
namespace {

using std::chrono::milliseconds;

volatile std::sig_atomic_t g_interrupted = 0;

extern "C" void OnInterrupt(int signal) {
  g_interrupted = 1;
  std::signal(signal, SIG_DFL);
}

bool IsTerminal() {
  static const bool is_terminal = ::isatty(STDERR_FILENO) == 1;
  return is_terminal;
}

// The terminal's current line shows progress.
bool line_is_open = false;

void CloseLine() {
  if (line_is_open) std::fputc('\n', stderr);
  line_is_open = false;
}

}  // namespace

void CatchInterrupts() {
  std::signal(SIGINT, OnInterrupt);
  std::signal(SIGTERM, OnInterrupt);
}

bool Interrupted() { return g_interrupted != 0; }

void PrintMessage(std::string_view kind, std::string_view message) {
  CloseLine();
  std::string line = "monoperfcap: " + std::string(kind) + ": " + std::string(message);
  std::replace(line.begin(), line.end(), '\n', ' ');
  std::fprintf(stderr, "%s\n", line.c_str());
}

ConsoleProgress::ConsoleProgress(bool quiet) : quiet_(quiet) {}

ConsoleProgress::~ConsoleProgress() { CloseLine(); }

bool ConsoleProgress::operator()(const mpc::Progress& progress) {
  if (quiet_) return !Interrupted();
  const auto now = mpc::ProgressFormatter::Clock::now();
  const std::string line = formatter_.Line(progress, now);
  const bool is_new_stage = progress.stage != stage_;
  const bool is_last = progress.step >= progress.num_steps;
  if (is_new_stage || is_last || now >= next_) {
    if (IsTerminal()) {
      if (is_new_stage) CloseLine();
      std::fprintf(stderr, "\r%s\x1b[K", line.c_str());
      line_is_open = true;
    } else {
      std::fprintf(stderr, "%s\n", line.c_str());
    }
    std::fflush(stderr);
    stage_ = progress.stage;
    next_ = now + (IsTerminal() ? milliseconds(100) : milliseconds(1000));
  }
  return !Interrupted();
}

}  // namespace monoperfcap
