#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "command.h"
#include "mpc/core/units.h"
#include "mpc/eval/motions.h"
#include "synthetic_clip.h"
#include "threads_option.h"

namespace monoperfcap {
namespace {

struct SynthArguments {
  SyntheticClipRequest request;
  double fov_deg = 60;
  std::string camera = "static";
  std::string noise = "measured";
  std::string outfit = std::string(mpc::OutfitName(mpc::Outfit::kCasual));
  std::string place;  // empty: by seed
  bool still_background = false;
};

// The names of all values of an enumeration.
template <typename Values, typename Name>
std::vector<std::string> Names(const Values& values, Name name) {
  std::vector<std::string> names;
  for (const auto value : values) names.emplace_back(name(value));
  return names;
}

template <typename Values, typename Name>
auto Find(const Values& values, Name name, const std::string& wanted) {
  for (const auto value : values) {
    if (name(value) == wanted) return value;
  }
  return values.front();
}

int Run(const SynthArguments& arguments) {
  SyntheticClipRequest request = arguments.request;
  mpc::PerformanceOptions& options = request.options;
  options.camera.fov_rad = arguments.fov_deg * mpc::kDegree;
  options.camera.motion = Find(mpc::kAllCameraMotions, mpc::CameraMotionName, arguments.camera);
  options.errors = Find(mpc::kAllDetectionErrors, mpc::DetectionErrorsName, arguments.noise);
  request.outfit = Find(mpc::kAllOutfits, mpc::OutfitName, arguments.outfit);
  options.camera.seed = options.scene.seed = options.seed;
  options.scene.moving_background = !arguments.still_background;
  options.scene.place = arguments.place.empty()
                            ? mpc::kAllPlaces[(options.seed + 2) % mpc::kAllPlaces.size()]
                            : Find(mpc::kAllPlaces, mpc::PlaceName, arguments.place);
  std::string summary;
  if (!WriteSyntheticClip(request, &summary)) return kExitInterrupted;
  std::fputs(summary.c_str(), stdout);
  return kExitOk;
}

void AddCameraOptions(CLI::App* app, SynthArguments* arguments) {
  mpc::SyntheticCameraOptions& camera = arguments->request.options.camera;
  app->add_option("--camera", arguments->camera, "How the camera moves")
      ->check(CLI::IsMember(Names(mpc::kAllCameraMotions, mpc::CameraMotionName)))
      ->capture_default_str();
  app->add_option("--shake", camera.shake, "How much a handheld camera trembles, 1 as a hand does")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str();
  app->add_option("--width", camera.width, "Width of the picture")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  app->add_option("--height", camera.height, "Height of the picture")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  app->add_option("--fov", arguments->fov_deg, "Field of view of the longer side, degrees")
      ->check(CLI::Range(10.0, 120.0))
      ->capture_default_str();
}

void AddSceneOptions(CLI::App* app, SynthArguments* arguments) {
  mpc::SceneOptions& scene = arguments->request.options.scene;
  app->add_option("--place", arguments->place, "Where it happens; default: by seed")
      ->check(CLI::IsMember(Names(mpc::kAllPlaces, mpc::PlaceName)));
  app->add_flag("--occluders", scene.occluders, "A post and a box between camera and actor");
  app->add_flag("--still-background", arguments->still_background,
                "Nothing moves behind the actor");
  app->add_option("--shutter", scene.shutter, "How long it is open, in frames: motion blur")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app->add_option("--samples", scene.samples, "Pictures averaged per frame")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app->add_option("--sensor-noise", scene.sensor_noise,
                  "Standard deviation of every value of the picture, of 255")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
}

}  // namespace

Command AddSynthCommand(CLI::App* parent) {
  CLI::App* const app =
      parent->add_subcommand("synth", "Make a clip with known truth to try the capture on");
  const auto arguments = std::make_shared<SynthArguments>();
  SyntheticClipRequest& request = arguments->request;
  app->add_option("-o,--output", request.output, "Folder for the files")->required();
  const std::vector<std::string> motions = Names(mpc::kAllMotions, mpc::MotionName);
  app->add_option("--motion", request.motion, "What the actor does, or a BVH file")
      ->check([motions](const std::string& motion) {
        if (IsBvhPath(motion)) return std::string();
        return CLI::IsMember(motions)(motion);
      })
      ->capture_default_str();
  app->add_option("--actor", request.actor, "Rigged mesh (.glb); default: the program's own");
  app->add_option("--outfit", arguments->outfit, "What the program's own actor wears")
      ->check(CLI::IsMember(Names(mpc::kAllOutfits, mpc::OutfitName)))
      ->capture_default_str();
  app->add_option("--noise", arguments->noise,
                  "Errors of the detections: as measured on a network, white, exact, or off: none")
      ->check(CLI::IsMember(Names(mpc::kAllDetectionErrors, mpc::DetectionErrorsName)))
      ->capture_default_str();
  app->add_option("--seconds", request.seconds, "Length of the clip")
      ->check(CLI::Range(0.01, 3600.0))
      ->capture_default_str();
  app->add_option("--start", request.start_s, "Where a BVH file is cut, seconds")
      ->check(CLI::Range(0.0, 1e6));
  app->add_option("--fps", request.fps, "Frames per second")
      ->check(CLI::Range(1.0, 240.0))
      ->capture_default_str();
  AddCameraOptions(app, arguments.get());
  AddSceneOptions(app, arguments.get());
  app->add_option("--seed", request.options.seed, "Of everything that is drawn by chance")
      ->check(CLI::Range(std::uint64_t{0}, (std::uint64_t{1} << 53) - 1))  // a number in JSON
      ->capture_default_str();
  AddThreadsOption(app, &request.num_threads);
  app->add_flag("--quiet", request.quiet, "No progress");
  return {app, [arguments] { return Run(*arguments); }};
}

}  // namespace monoperfcap
