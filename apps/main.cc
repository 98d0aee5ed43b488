// monoperfcap: performance capture from one video, on the command line.
//
// Exit codes: 0 ok, 1 error (one sentence on stderr), 2 usage, 130 interrupted.

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <string_view>
#include <vector>

#include "command.h"
#include "console.h"
#include "mpc/core/error.h"
#include "mpc/core/log.h"

namespace monoperfcap {
namespace {

int RunCommandLine(int argc, char** argv) {
  CLI::App app("Performance capture from one video of one person and that person's rigged mesh.");
  app.require_subcommand(1);
  CLI::App* const actor = app.add_subcommand("actor", "Look at an actor's rig");
  actor->require_subcommand(1);
  const std::vector<Command> commands = {AddCaptureCommand(&app), AddActorInfoCommand(actor),
                                         AddBenchCommand(&app),   AddDetectCommand(&app),
                                         AddSegmentCommand(&app), AddRenderCommand(&app),
                                         AddEvalCommand(&app),    AddSynthCommand(&app)};
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kExitOk : kExitUsage;
  }
  for (const Command& command : commands) {
    if (!command.app->parsed()) continue;
    const int exit_code = command.run();
    if (std::fflush(stdout) != 0) {
      throw mpc::Error(mpc::ErrorCode::kWriteFailed, "the standard output cannot be written");
    }
    return exit_code;
  }
  return kExitUsage;
}

int RunAndReport(int argc, char** argv) {
  try {
    return RunCommandLine(argc, argv);
  } catch (const mpc::Error& e) {
    PrintMessage("error", e.what());
    return e.code() == mpc::ErrorCode::kCancelled ? kExitInterrupted : kExitError;
  } catch (const std::bad_alloc&) {
    PrintMessage("error", "out of memory");
  } catch (const std::exception& e) {
    PrintMessage("error", e.what());
  } catch (...) {
    PrintMessage("error", "unknown failure");
  }
  return kExitError;
}

}  // namespace
}  // namespace monoperfcap

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a full disk quota is an error, not a signal
  monoperfcap::CatchInterrupts();
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);  // our own sentence says what is wrong
  mpc::SetLogSink([](mpc::LogLevel level, std::string_view message) {
    if (level == mpc::LogLevel::kWarning) monoperfcap::PrintMessage("warning", message);
  });
  return monoperfcap::RunAndReport(argc, argv);
}
