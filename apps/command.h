// Purpose: the subcommands of monoperfcap. Each adds itself to the command line and returns what to
// run when the user chose it: the exit code, or an exception that main reports in one sentence.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace monoperfcap {

inline constexpr int kExitOk = 0;
inline constexpr int kExitError = 1;
inline constexpr int kExitUsage = 2;
inline constexpr int kExitInterrupted = 130;

struct Command {
  CLI::App* app = nullptr;
  std::function<int()> run;
};

Command AddCaptureCommand(CLI::App* parent);
Command AddActorInfoCommand(CLI::App* parent);
Command AddBenchCommand(CLI::App* parent);
Command AddDetectCommand(CLI::App* parent);
Command AddEvalCommand(CLI::App* parent);
Command AddRenderCommand(CLI::App* parent);
Command AddSegmentCommand(CLI::App* parent);
Command AddSynthCommand(CLI::App* parent);

}  // namespace monoperfcap
