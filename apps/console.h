// Purpose: what the command says while it works, and how the user stops it.
#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "mpc/core/progress.h"

namespace monoperfcap {

// From now on Ctrl-C (SIGINT) and SIGTERM are remembered; a second one ends the program at once.
void CatchInterrupts();
bool Interrupted();

// Writes "monoperfcap: <kind>: <message>" to stderr as one line, off the progress line.
void PrintMessage(std::string_view kind, std::string_view message);

// Progress on stderr: one line that is rewritten on a terminal, else a line now and then.
// One object at a time.
class ConsoleProgress {
 public:
  explicit ConsoleProgress(bool quiet);
  ~ConsoleProgress();
  ConsoleProgress(const ConsoleProgress&) = delete;
  ConsoleProgress& operator=(const ConsoleProgress&) = delete;

  // False once the user interrupted: the shape of an mpc::ProgressCallback.
  bool operator()(const mpc::Progress& progress);

 private:
  bool quiet_;
  std::string stage_;
  mpc::ProgressFormatter formatter_;
  mpc::ProgressFormatter::Clock::time_point next_;
};

}  // namespace monoperfcap
