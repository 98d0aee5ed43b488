#include <fmt/format.h>

#include <cstdio>
#include <map>
#include <memory>
#include <string>

#include "command.h"
#include "console.h"
#include "detect_options.h"
#include "mpc/core/units.h"
#include "mpc/mpc.h"
#include "silhouette_summary.h"
#include "threads_option.h"

namespace monoperfcap {
namespace {

struct CaptureArguments {
  mpc::CaptureInputs inputs;
  DetectArguments detect;
  std::string output;
  double fov_deg = 0;
  std::string preset = "default";
  std::string fit_proportions;
  std::string surface = "key";
  double height_m = 0;
  int num_threads = 0;
  bool no_overlay = false;
  bool no_masks = false;
  bool no_person_masks = false;
  std::string refine = "surface";
  bool still_camera = false;
  bool quiet = false;
};

const std::map<std::string, mpc::RefinementLevel> kLevels = {
    {"none", mpc::RefinementLevel::kNone},
    {"pose", mpc::RefinementLevel::kPose},
    {"surface", mpc::RefinementLevel::kSurface}};

mpc::CaptureOptions MakeOptions(const CaptureArguments& arguments) {
  mpc::CaptureOptions options;
  if (arguments.preset == "paper") {
    options.pose = mpc::PoseOptions::Paper();
    options.refinement = mpc::ClipRefinementOptions::Paper();
    options.camera_turns = false;
  }
  if (!arguments.fit_proportions.empty()) {
    options.pose.fit_proportions = arguments.fit_proportions == "auto";
  }
  options.pose.num_threads = arguments.num_threads;
  options.detect = arguments.detect.Options();
  options.detect.cutoff_hz = options.pose.cutoff_hz;
  options.height_m = arguments.height_m;
  options.overlay = !arguments.no_overlay;
  options.masks = !arguments.no_masks;
  options.person_masks = !arguments.no_person_masks && arguments.preset != "paper";
  if (arguments.still_camera) options.camera_turns = false;
  options.refinement.frames.level = kLevels.at(arguments.refine);
  if (arguments.surface == "none") options.surface = mpc::SurfaceTargets::kNone;
  if (arguments.surface == "full") options.surface = mpc::SurfaceTargets::kFull;
  return options;
}

void PrintSummary(const CaptureArguments& arguments, const mpc::CaptureReport& report) {
  double residual_px = 0;
  int num_seen = 0;
  for (const mpc::FrameReport& frame : report.track.frames) {
    if (frame.state == mpc::TrackState::kInterpolated) continue;
    residual_px += frame.residual_px;
    ++num_seen;
  }
  std::string files;
  for (const std::string& name : report.outputs) files += " " + name;
  std::printf("%s", fmt::format("{}:{}\n{} frames, {:.3g} frames per second; joints lie {:.1f} px "
                                "from their detections on average ({} frames)\n",
                                arguments.output, files, report.num_frames, report.fps,
                                num_seen > 0 ? residual_px / num_seen : 0.0, num_seen)
                        .c_str());
  std::printf("%s", RefinementSummary(report.refinement).c_str());
  const mpc::GltfSurfaceError& surface = report.surface;
  if (surface.num_targets > 0) {
    std::printf("%s",
                fmt::format("performance.glb shows the surface with {} morph targets, {:.2g} mm "
                            "from it on average, {:.2g} mm at most\n",
                            surface.num_targets, 1000 * surface.mean_m, 1000 * surface.max_m)
                    .c_str());
  }
}

int Run(const CaptureArguments& arguments) {
  mpc::CaptureInputs inputs = arguments.inputs;
  inputs.models = arguments.detect.models;
  inputs.fov_rad = arguments.fov_deg * mpc::kDegree;
  mpc::Capture capture(inputs, arguments.output, MakeOptions(arguments));
  ConsoleProgress progress(arguments.quiet);
  const mpc::CaptureReport report =
      capture.Run([&progress](const mpc::Progress& step) { return progress(step); });
  for (const std::string& warning : report.warnings) PrintMessage("warning", warning);
  if (!report.complete) {
    PrintMessage("error", "interrupted: what was finished is in " + arguments.output);
    return kExitInterrupted;
  }
  PrintSummary(arguments, report);
  return kExitOk;
}

}  // namespace

Command AddCaptureCommand(CLI::App* parent) {
  CLI::App* const app = parent->add_subcommand("capture", "Capture the performance in a video");
  const auto arguments = std::make_shared<CaptureArguments>();
  mpc::CaptureInputs& inputs = arguments->inputs;
  app->add_option("clip", inputs.video, "Video, or a folder of numbered pictures")->required();
  app->add_option("--actor", inputs.actor, "The person's rigged mesh: .glb or .gltf")->required();
  CLI::Option_group* const camera =
      app->add_option_group("camera", "The camera; without: estimated from the clip");
  camera->add_option("--camera", inputs.camera, "Camera: FILE.json or FILE.json:NAME");
  camera->add_option("--fov", arguments->fov_deg, "Field of view of the longer side, degrees")
      ->check(CLI::Range(1.0, 179.0));
  camera->require_option(0, 1);
  app->add_flag("--still-camera", arguments->still_camera,
                "The camera rests: do not look whether it turns (so in the paper's preset)");
  app->add_option("--detections2d", inputs.detections2d,
                  "Joints in 2D: OpenPose, BlazePose or our own JSON; without: the networks'");
  app->add_option("--detections3d", inputs.detections3d, "Joints in 3D: BlazePose or our own JSON");
  arguments->detect.AddTo(app);
  app->add_option("-o,--output", arguments->output, "Folder for the results")->required();
  app->add_option("--preset", arguments->preset, "Method: default, or exactly the paper's")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  app->add_option("--fit-proportions", arguments->fit_proportions,
                  "Fit the actor's proportions to the person (auto, but off in the paper's preset)")
      ->check(CLI::IsMember({"auto", "off"}));
  app->add_option("--height", arguments->height_m, "Scale the actor to this height first, metres")
      ->check(CLI::Range(0.5, 2.5));
  app->add_option("--image-fps", inputs.image_fps, "Frames per second of a folder of pictures")
      ->check(CLI::Range(0.1, 1000.0));
  AddThreadsOption(app, &arguments->num_threads);
  CLI::Option* const masks = app->add_option(
      "--masks", inputs.masks,
      "Your own masks in place of extracted silhouettes: a video, or a folder of pictures");
  CLI::Option* const true_masks =
      app->add_option("--true-masks", inputs.true_masks,
                      "Masks to compare the silhouettes with: a video, or a folder of pictures");
  app->add_flag("--no-masks", arguments->no_masks, "Find no silhouettes, and refine nothing")
      ->excludes(masks)
      ->excludes(true_masks);
  app->add_flag(
      "--no-person-masks", arguments->no_person_masks,
      "Silhouettes without the networks' masks of the person (off in the paper's preset)");
  app->add_option("--refine", arguments->refine,
                  "What is fitted to the silhouettes: nothing, the pose, or pose and surface")
      ->check(CLI::IsMember({"none", "pose", "surface"}))
      ->capture_default_str();
  app->add_option("--surface", arguments->surface,
                  "Surface in performance.glb as morph targets: none, key (ten per second), full")
      ->check(CLI::IsMember({"none", "key", "full"}))
      ->capture_default_str();
  app->add_flag("--no-overlay", arguments->no_overlay, "Do not make overlay.mp4");
  app->add_flag("--quiet", arguments->quiet, "No progress");
  return {app, [arguments] { return Run(*arguments); }};
}

}  // namespace monoperfcap
