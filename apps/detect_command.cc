#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>

#include "command.h"
#include "console.h"
#include "detect_options.h"
#include "mpc/detect_clip.h"

namespace monoperfcap {
namespace {

struct DetectCommandArguments {
  mpc::ClipToDetect clip;
  std::string output;
  DetectArguments detect;
  bool no_overlay = false;
  bool quiet = false;
};

int Run(const DetectCommandArguments& arguments) {
  mpc::ClipToDetect clip = arguments.clip;
  clip.models = arguments.detect.models;
  ConsoleProgress progress(arguments.quiet);
  const mpc::ClipDetections detections =
      mpc::DetectToFolder(clip, arguments.output, arguments.detect.Options(), !arguments.no_overlay,
                          [&progress](const mpc::Progress& step) { return progress(step); });
  for (const std::string& warning : mpc::DetectionWarnings(detections)) {
    PrintMessage("warning", warning);
  }
  std::printf(
      "%s",
      fmt::format("{}: {} {}{}\n{} frames, looked at every {} at most: person found in {} of "
                  "{}\n",
                  arguments.output, mpc::kDetections2dName, mpc::kDetections3dName,
                  arguments.no_overlay ? "" : " overlay.mp4", detections.detections2d.frames.size(),
                  detections.every, detections.num_seen, detections.num_looks)
          .c_str());
  return kExitOk;
}

}  // namespace

Command AddDetectCommand(CLI::App* parent) {
  CLI::App* const app = parent->add_subcommand("detect", "Find a person's joints in a video");
  const auto arguments = std::make_shared<DetectCommandArguments>();
  app->add_option("clip", arguments->clip.video, "Video, or a folder of numbered pictures")
      ->required();
  app->add_option("-o,--output", arguments->output, "Folder for the results")->required();
  arguments->detect.AddTo(app);
  app->add_option("--image-fps", arguments->clip.image_fps,
                  "Frames per second of a folder of pictures")
      ->check(CLI::Range(0.1, 1000.0));
  app->add_flag("--no-overlay", arguments->no_overlay, "Do not make overlay.mp4");
  app->add_flag("--quiet", arguments->quiet, "No progress");
  return {app, [arguments] { return Run(*arguments); }};
}

}  // namespace monoperfcap
