#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>

#include "command.h"
#include "console.h"
#include "mpc/core/units.h"
#include "mpc/free_view.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/gltf.h"
#include "mpc/io/pc2.h"
#include "mpc/mpc.h"
#include "threads_option.h"

namespace monoperfcap {
namespace {

struct RenderArguments {
  std::string take;
  std::string actor;
  std::string output;
  mpc::TakeView view;
  double orbit_deg = 0;
  double fps = 30;
  mpc::RenderOptions options;
  bool quiet = false;
};

[[noreturn]] void Fail(mpc::ErrorCode code, const std::string& text) {
  throw mpc::Error(code, text);
}

int Render(const RenderArguments& arguments, const mpc::ViewedSurface& surface) {
  ConsoleProgress progress(arguments.quiet);
  if (!mpc::RenderSurface(surface, arguments.output, arguments.options,
                          [&progress](const mpc::Progress& step) { return progress(step); })) {
    PrintMessage("error", "interrupted: nothing is left of " + arguments.output);
    return kExitInterrupted;
  }
  std::printf("%s", fmt::format("{}: {} frames of {} x {}, {:.3g} per second\n", arguments.output,
                                surface.num_frames, surface.camera.width, surface.camera.height,
                                surface.fps)
                        .c_str());
  return kExitOk;
}

// A point cache in the world of a camera.
int RenderCache(const RenderArguments& arguments) {
  if (arguments.actor.empty() || arguments.view.camera.empty() || arguments.orbit_deg != 0) {
    Fail(mpc::ErrorCode::kInvalidArgument,
         arguments.take + " is a point cache: it needs --actor and --camera, and has no --orbit");
  }
  const mpc::RigAsset rig = mpc::ReadRigGltf(arguments.actor);
  mpc::Pc2Reader cache(arguments.take);
  if (cache.num_vertices() != rig.num_vertices()) {
    Fail(mpc::ErrorCode::kMismatch,
         fmt::format("{} has {} vertices, {} has {}", arguments.take, cache.num_vertices(),
                     arguments.actor, rig.num_vertices()));
  }
  const mpc::Camera camera = mpc::ReadCamera(arguments.view.camera);
  const std::vector<mpc::CameraFromWorld> motion = mpc::ReadCameraMotion(arguments.view.camera);
  if (!motion.empty() && motion.size() != static_cast<size_t>(cache.num_frames())) {
    Fail(mpc::ErrorCode::kMismatch,
         fmt::format("{} has {} frames, {} has {}", arguments.view.camera, motion.size(),
                     arguments.take, cache.num_frames()));
  }
  const auto vertices = [&](int frame, Eigen::Matrix3Xf* positions) {
    cache.Read(frame, positions);
    const mpc::CameraFromWorld& place =
        motion.empty() ? camera.camera_from_world : motion[static_cast<size_t>(frame)];
    const Eigen::Matrix3Xd turned = place.rotation * positions->cast<double>();
    *positions = (turned.colwise() + place.translation).cast<float>();
  };
  return Render(arguments, {.rig = rig,
                            .camera = camera,
                            .fps = arguments.fps,
                            .num_frames = cache.num_frames(),
                            .vertices = vertices,
                            .inputs = {arguments.take, arguments.actor}});
}

int Run(const RenderArguments& arguments) {
  if (arguments.take.ends_with(".pc2")) return RenderCache(arguments);
  const mpc::Take take = mpc::ReadTake(arguments.take, {}, arguments.actor);
  mpc::TakeView view = arguments.view;
  view.orbit_rad = arguments.orbit_deg * mpc::kDegree;
  return Render(arguments, mpc::ViewOfTake(take, view));
}

}  // namespace

Command AddRenderCommand(CLI::App* parent) {
  CLI::App* const app =
      parent->add_subcommand("render", "See a captured performance from any camera");
  const auto arguments = std::make_shared<RenderArguments>();
  mpc::RenderOptions& options = arguments->options;
  app->add_option("take", arguments->take,
                  "Folder of a capture, or a point cache (.pc2) in the world of --camera")
      ->required();
  app->add_option("-o,--output", arguments->output, "Video (.mp4), or a folder for pictures (PNG)")
      ->required();
  app->add_option("--camera", arguments->view.camera,
                  "Another camera of the same world, or a path (\"frames\"): FILE.json:NAME");
  CLI::Option* const orbit =
      app->add_option("--orbit", arguments->orbit_deg, "Go round the person by so many degrees");
  orbit->check(CLI::Range(-36000.0, 36000.0));
  CLI::Option* const background =
      app->add_option("--background", options.background,
                      "Picture or video behind the person, of the camera's size");
  background->excludes(orbit);
  app->add_flag("--mask", options.mask, "Only the mask, white on black")->excludes(background);
  app->add_option("--actor", arguments->actor,
                  "The actor, for a point cache or where it is not in its place any more");
  app->add_option("--fps", arguments->fps, "Frames per second of a point cache")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  AddThreadsOption(app, &options.num_threads);
  app->add_flag("--quiet", arguments->quiet, "No progress");
  return {app, [arguments] { return Run(*arguments); }};
}

}  // namespace monoperfcap
