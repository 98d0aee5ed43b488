#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "console.h"
#include "evaluation.h"
#include "evaluation_page.h"
#include "evaluation_table.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/pc2.h"
#include "mpc/skeleton/world.h"
#include "mpc/take.h"
#include "threads_option.h"
#include "worst_frames.h"

namespace monoperfcap {
namespace {

namespace fs = std::filesystem;

struct EvalArguments {
  fs::path estimate;
  fs::path truth;
  fs::path true_masks;
  std::string joints = "14";
  std::string json;  // a file, or "-" for stdout
  bool wants_json = false;
  fs::path html;
  int num_threads = 0;
  bool no_html = false;
  bool quiet = false;
};

JointSet ScoredSet(const EvalArguments& arguments) {
  return arguments.joints == "all" ? JointSet::kAll : JointSet::k14;
}

// Table or JSON on stdout, JSON in a file.
void Print(const EvalArguments& arguments, const Evaluation& evaluation) {
  const bool to_stdout = arguments.wants_json && arguments.json.empty();
  if (to_stdout) {
    std::printf("%s\n", EvaluationJson(evaluation).dump(1).c_str());
    return;
  }
  if (arguments.wants_json) {
    mpc::WriteFileAtomically(arguments.json, EvaluationJson(evaluation).dump(1) + "\n");
  }
  std::printf("%s", EvaluationText(evaluation).c_str());
}

int RunOnJoints(const EvalArguments& arguments) {
  if (!arguments.true_masks.empty() || !arguments.html.empty()) {
    throw mpc::Error(mpc::ErrorCode::kInvalidArgument,
                     fmt::format("{} is a file of joints: masks and pages need a capture's folder",
                                 arguments.estimate.string()));
  }
  const mpc::JointTrack estimate = mpc::ReadJointTrack(arguments.estimate);
  const Truth truth = ReadTruth(arguments.truth);
  Print(arguments, EvaluateJoints(estimate, truth.joints, ScoredSet(arguments),
                                  arguments.estimate.string(), truth.name));
  return kExitOk;
}

// The captured surface, surface.pc2, from the scene into the camera of each frame.
class CapturedSurface {
 public:
  CapturedSurface(const fs::path& take, Eigen::Index num_vertices, Eigen::Index num_frames)
      : reader_(take / "surface.pc2") {
    if (reader_.num_vertices() != num_vertices || reader_.num_frames() != num_frames) {
      throw mpc::Error(mpc::ErrorCode::kMismatch,
                       fmt::format("{} has {} vertices in {} frames, the capture {} in {}",
                                   (take / "surface.pc2").string(), reader_.num_vertices(),
                                   reader_.num_frames(), num_vertices, num_frames));
    }
    const fs::path report = take / "report.json";
    const auto json = nlohmann::json::parse(mpc::ReadFile(report), nullptr, false);
    try {
      const nlohmann::json& world = json.at("world");
      const auto scene_from_world =
          ReadTransform<mpc::SceneFrame, mpc::WorldFrame>(world.at("scene_from_world"));
      for (Eigen::Index f = 0; f < num_frames; ++f) {
        const nlohmann::json& frame = json.at("frames").at(static_cast<size_t>(f));
        const auto world_from_camera = ReadTransform<mpc::WorldFrame, mpc::CameraFrame>(
            frame.contains("world_from_camera") ? frame.at("world_from_camera")
                                                : world.at("world_from_camera"));
        camera_from_scene_.push_back((scene_from_world * world_from_camera).Inverse());
      }
    } catch (const nlohmann::json::exception& e) {
      throw mpc::Error(
          mpc::ErrorCode::kBadFile,
          fmt::format("{} does not say where the scene is: {}", report.string(), e.what()));
    }
  }

  // In front of the camera, 3xV; from any thread.
  void Read(int frame, Eigen::Matrix3Xf* vertices) {
    {
      const std::scoped_lock lock(mutex_);
      reader_.Read(frame, vertices);
    }
    const auto& to_camera = camera_from_scene_[static_cast<size_t>(frame)];
    *vertices = (to_camera.rotation.cast<float>() * *vertices).colwise() +
                to_camera.translation.cast<float>();
  }

 private:
  template <typename To, typename From>
  static mpc::Rigid<To, From> ReadTransform(const nlohmann::json& json) {
    mpc::Rigid<To, From> transform;
    for (int row = 0; row < 3; ++row) {
      transform.translation[row] = json.at("t").at(row).get<double>();
      for (int k = 0; k < 3; ++k) {
        transform.rotation(row, k) = json.at("R").at(row).at(k).get<double>();
      }
    }
    return transform;
  }

  std::mutex mutex_;
  mpc::Pc2Reader reader_;
  std::vector<mpc::Rigid<mpc::CameraFrame, mpc::SceneFrame>> camera_from_scene_;  // F
};

std::vector<FramePicture> TryPictures(const Performance& performance, const Truth& truth,
                                      const mpc::Take& take, Evaluation* evaluation) {
  const bool has_clip = !truth.video.empty();
  try {
    return WorstFrames(performance, truth, *evaluation, has_clip ? truth.video : take.video,
                       has_clip ? 0 : take.image_fps);
  } catch (const mpc::Error& error) {
    evaluation->skipped.push_back(fmt::format("pictures of the worst frames: {}", error.what()));
    return {};
  }
}

int RunOnTake(const EvalArguments& arguments) {
  const mpc::Take take = mpc::ReadTake(arguments.estimate);
  const Truth truth = ReadTruth(arguments.truth, arguments.true_masks);
  Performance performance{.name = arguments.estimate.string(),
                          .camera = take.camera,
                          .character = take.character,
                          .poses = take.poses,
                          .fps = take.fps,
                          .vertices = {},
                          .silhouettes = {}};
  std::error_code ec;
  const fs::path masks = arguments.estimate / "masks.mp4";
  if (fs::exists(masks, ec)) performance.silhouettes = masks;
  std::unique_ptr<CapturedSurface> surface;
  if (fs::exists(arguments.estimate / "surface.pc2", ec)) {
    surface = std::make_unique<CapturedSurface>(
        arguments.estimate, take.character.mesh.positions.cols(), take.poses.cols());
    performance.vertices = [&surface](int frame, Eigen::Matrix3Xf* vertices) {
      surface->Read(frame, vertices);
    };
  }
  ConsoleProgress progress(arguments.quiet);
  Evaluation evaluation = Evaluate(
      performance, truth, {.joints = ScoredSet(arguments), .num_threads = arguments.num_threads},
      [&progress](const mpc::Progress& step) { return progress(step); });
  if (!arguments.no_html) {
    const std::vector<FramePicture> pictures = TryPictures(performance, truth, take, &evaluation);
    const fs::path page =
        arguments.html.empty() ? arguments.estimate / "evaluation.html" : arguments.html;
    mpc::WriteFileAtomically(page, EvaluationPage(evaluation, pictures));
    if (!arguments.quiet) PrintMessage("wrote", page.string());
  }
  Print(arguments, evaluation);
  return kExitOk;
}

int Run(const EvalArguments& arguments) {
  std::error_code ec;
  return fs::is_directory(arguments.estimate, ec) ? RunOnTake(arguments) : RunOnJoints(arguments);
}

}  // namespace

Command AddEvalCommand(CLI::App* parent) {
  CLI::App* const app =
      parent->add_subcommand("eval", "Compare a capture, or its joints alone, with the truth");
  const auto arguments = std::make_shared<EvalArguments>();
  app->add_option("take", arguments->estimate, "Folder of a capture, or a joints.trc")->required();
  app->add_option("--truth", arguments->truth,
                  "The truth: a clip's folder or truth.json, or joints as .trc or .json")
      ->required();
  app->add_option("--true-masks", arguments->true_masks,
                  "True masks of the person: a video, or a folder of pictures");
  app->add_option("--joints", arguments->joints,
                  "14: shoulders, elbows, wrists, hips, knees, ankles, toes; all: what both have")
      ->check(CLI::IsMember({"14", "all"}))
      ->capture_default_str();
  CLI::Option* const json =
      app->add_option("--json", arguments->json, "Also as JSON into FILE; alone: JSON on stdout")
          ->expected(0, 1)
          ->type_name("FILE");
  app->add_option("--html", arguments->html, "The page with plots; default: TAKE/evaluation.html")
      ->type_name("FILE");
  app->add_flag("--no-html", arguments->no_html, "No page");
  AddThreadsOption(app, &arguments->num_threads);
  app->add_flag("--quiet", arguments->quiet, "No progress");
  return {app, [arguments, json] {
            arguments->wants_json = json->count() > 0;
            return Run(*arguments);
          }};
}

}  // namespace monoperfcap
