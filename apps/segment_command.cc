#include <cstdio>
#include <memory>
#include <string>

#include "command.h"
#include "console.h"
#include "mpc/mpc.h"
#include "silhouette_summary.h"
#include "threads_option.h"

namespace monoperfcap {
namespace {

struct SegmentArguments {
  std::string take;
  std::string video;
  std::string actor;
  std::string output;
  std::string preset = "default";
  mpc::SegmentOptions options;
  int num_threads = 0;
  bool no_overlay = false;
  bool quiet = false;
};

int Run(const SegmentArguments& arguments) {
  mpc::SegmentOptions options = arguments.options;
  if (arguments.preset == "paper") options.silhouettes = mpc::SilhouetteOptions::Paper();
  options.silhouettes.num_threads = arguments.num_threads;
  options.overlay = !arguments.no_overlay;
  const mpc::Take take = mpc::ReadTake(arguments.take, arguments.video, arguments.actor);
  ConsoleProgress progress(arguments.quiet);
  const mpc::SegmentReport report =
      mpc::SegmentTake(take, arguments.output, options,
                       [&progress](const mpc::Progress& step) { return progress(step); });
  for (const std::string& warning : report.warnings) PrintMessage("warning", warning);
  if (!report.complete) {
    PrintMessage("error", "interrupted: only the report is in " + arguments.output);
    return kExitInterrupted;
  }
  std::string files;
  for (const std::string& name : report.outputs) files += " " + name;
  std::printf("%s:%s\n%s", arguments.output.c_str(), files.c_str(),
              SilhouetteSummary(report.frames).c_str());
  return kExitOk;
}

}  // namespace

Command AddSegmentCommand(CLI::App* parent) {
  CLI::App* const app =
      parent->add_subcommand("segment", "Find the silhouettes of a captured performance again");
  const auto arguments = std::make_shared<SegmentArguments>();
  mpc::SegmentOptions& options = arguments->options;
  app->add_option("take", arguments->take, "Folder of a capture (its poses.json)")->required();
  app->add_option("clip", arguments->video, "The video, where it is not in its place any more");
  app->add_option("--actor", arguments->actor, "The actor, where it is not in its place any more");
  app->add_option("-o,--output", arguments->output, "Folder for the results")->required();
  app->add_option("--preset", arguments->preset, "Method: default, or exactly the paper's")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  app->add_option("--true-masks", options.true_masks,
                  "Masks to compare with: a video, or a folder of pictures");
  app->add_flag("--png", options.pictures, "Write masks/000000.png, ... too");
  AddThreadsOption(app, &arguments->num_threads);
  app->add_flag("--no-overlay", arguments->no_overlay, "Do not make overlay.mp4");
  app->add_flag("--quiet", arguments->quiet, "No progress");
  return {app, [arguments] { return Run(*arguments); }};
}

}  // namespace monoperfcap
