#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "bench_results.h"
#include "bench_stages.h"
#include "bench_suite.h"
#include "command.h"
#include "console.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/pc2.h"

namespace monoperfcap {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct BenchArguments {
  fs::path output;
  std::string suite = "full";
  std::string noise;  // of all synthetic clips; empty: as the suite says
  fs::path data;
  fs::path expected;
  bool fresh = false;
  bool no_real = false;
  bool quiet = false;
};

// A clip of the run: synthetic, or real and known by its name.
struct Item {
  std::string name;
  std::optional<SyntheticSpec> spec;
  fs::path data;

  // What a finished result must have been made from, to be used again.
  Json Description() const {
    Json stages = Json::array();
    for (const Stage& stage : Stages()) stages.push_back(stage.key);
    return {{"clip", spec ? SpecJson(*spec) : Json(name)}, {"stages", std::move(stages)}};
  }
};

std::optional<Json> TryReadJson(const fs::path& path) {
  std::error_code ec;
  if (!fs::exists(path, ec)) return std::nullopt;
  const Json json = Json::parse(mpc::ReadFile(path), nullptr, /*allow_exceptions=*/false);
  return json.is_object() ? std::optional<Json>(json) : std::nullopt;
}

// The clip's folder, made unless it is there. False when the user interrupted.
bool MakeClip(const SyntheticSpec& spec, const fs::path& folder) {
  const fs::path note = folder / "spec.json";
  std::error_code ec;
  if (fs::exists(folder / "truth.json", ec) && TryReadJson(note) == SpecJson(spec)) return true;
  fs::remove_all(folder, ec);
  fs::create_directories(folder, ec);
  CLI::App app;
  const Command synth = AddSynthCommand(&app);
  std::vector<std::string> arguments = {"synth", "--quiet", "-o", folder.string()};
  const auto add = [&arguments](const char* option, const std::string& value) {
    arguments.insert(arguments.end(), {option, value});
  };
  add("--motion", spec.motion);
  add("--outfit", spec.outfit);
  add("--camera", spec.camera);
  add("--noise", spec.noise);
  add("--seed", fmt::format("{}", spec.seed));
  add("--seconds", fmt::format("{}", spec.seconds));
  add("--fps", fmt::format("{}", spec.fps));
  add("--width", fmt::format("{}", spec.width));
  add("--height", fmt::format("{}", spec.height));
  std::reverse(arguments.begin(), arguments.end());
  try {
    app.parse(arguments);
  } catch (const CLI::Error& e) {
    throw mpc::Error(mpc::ErrorCode::kInvalidArgument,
                     fmt::format("clip {}: {}", spec.name, e.what()));
  }
  try {
    if (synth.run() != kExitOk) return false;
  } catch (const mpc::Error& error) {
    if (error.code() == mpc::ErrorCode::kCancelled) return false;
    throw;
  }
  mpc::WriteFileAtomically(note, SpecJson(spec).dump(1) + "\n");
  return true;
}

// Numbers of the truth that a change of motion, actor or skinning changes.
Row Fingerprint(const BenchClip& clip) {
  const Eigen::MatrixXd& joints = clip.truth.joints.positions;
  const Eigen::Matrix3Xd points = joints.reshaped(3, joints.size() / 3);
  const Eigen::Vector3d centre = points.rowwise().mean();
  Row row = {{"joint_spread_mm",
              1000 * std::sqrt((points.colwise() - centre).squaredNorm() / double(points.cols()))}};
  mpc::Pc2Reader vertices(clip.truth.vertices);
  Eigen::Matrix3Xf frame;
  double area = 0;
  for (int f = 0; f < vertices.num_frames(); ++f) {
    vertices.Read(f, &frame);
    for (const auto& t : clip.character.mesh.triangles.colwise()) {
      const Eigen::Vector3f a = frame.col(t[0]), b = frame.col(t[1]), c = frame.col(t[2]);
      area += 0.5 * double((b - a).cross(c - a).norm());
    }
  }
  row["mean_area_m2"] = area / vertices.num_frames();
  return row;
}

class Bench {
 public:
  explicit Bench(const BenchArguments& arguments)
      : arguments_(arguments), progress_(arguments.quiet) {
    for (SyntheticSpec& spec : ReadSuite(arguments.suite)) {
      if (!arguments.noise.empty()) spec.noise = arguments.noise;
      items_.push_back({spec.name, spec, {}});
    }
    if (!arguments.no_real) {
      for (const std::string& name : RealClips(arguments.data)) {
        items_.push_back({name, std::nullopt, arguments.data});
      }
    }
  }

  // False when the user interrupted; finished clips are kept.
  bool Run() {
    for (const Item& item : items_) {
      if (!RunClip(item)) return false;
      done_ = static_cast<int>(results_.size()) * (num_stages_ + 1);
    }
    return true;
  }

  const std::vector<ClipResult>& results() const { return results_; }

 private:
  bool Step(const std::string& what) {
    const int total = static_cast<int>(items_.size()) * (num_stages_ + 1);
    return progress_({what, done_++, total});
  }

  bool RunClip(const Item& item) {
    const fs::path folder = arguments_.output / item.name;
    const fs::path file = folder / "result.json";
    std::error_code ec;
    if (arguments_.fresh) fs::remove_all(folder, ec);
    if (const std::optional<Json> json = TryReadJson(file)) {
      if (json->value("from", Json()) == item.Description() && TryAddResult(*json)) return true;
    }
    fs::create_directories(folder, ec);
    if (!Step("clips")) return false;
    if (item.spec && !MakeClip(*item.spec, folder / "clip")) return false;
    const BenchClip clip = item.spec ? ReadSyntheticClip(item.name, folder / "clip")
                                     : ReadRealClip(item.name, item.data);
    ClipResult result{.name = item.name,
                      .is_real = !item.spec,
                      .num_frames = clip.num_frames(),
                      .fps = clip.fps,
                      .stages = {},
                      .fingerprint = item.spec ? Fingerprint(clip) : Row{}};
    if (!RunStages(clip, &result)) return false;
    Json json = ResultJson(result);
    json["from"] = item.Description();
    mpc::WriteFileAtomically(file, json.dump(1) + "\n");
    results_.push_back(std::move(result));
    return true;
  }

  bool TryAddResult(const Json& json) {
    try {
      results_.push_back(ParseResult(json));
      return true;
    } catch (const nlohmann::json::exception&) {
      return false;
    }
  }

  bool RunStages(const BenchClip& clip, ClipResult* result) {
    StageOutputs outputs;
    for (const Stage& stage : Stages()) {
      if (!Step("clips")) return false;
      const StageOutput& output = outputs[stage.key] = stage.run(clip, outputs);
      if (Interrupted()) return false;
      const Performance performance{.name = clip.name,
                                    .camera = clip.camera,
                                    .character = output.character,
                                    .poses = output.poses,
                                    .fps = clip.fps,
                                    .vertices = output.vertices,
                                    .silhouettes = {}};
      const Evaluation evaluation = Evaluate(performance, clip.truth, {.surface_distance = false});
      result->stages[stage.key] = MakeRow(evaluation, output.seconds / clip.num_frames());
    }
    return true;
  }

  const BenchArguments& arguments_;
  ConsoleProgress progress_;
  std::vector<Item> items_;
  std::vector<ClipResult> results_;
  const int num_stages_ = static_cast<int>(Stages().size());
  int done_ = 0;  // steps, for the progress
};

std::vector<ClipResult> ReadResults(const fs::path& path) {
  std::vector<ClipResult> results;
  const std::string text = mpc::ReadFile(path);
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    for (const nlohmann::json& clip : json.at("clips")) results.push_back(ParseResult(clip));
  } catch (const nlohmann::json::exception& e) {
    throw mpc::Error(mpc::ErrorCode::kBadFile,
                     fmt::format("{} holds no results: {}", path.string(), e.what()));
  }
  return results;
}

int Run(const BenchArguments& arguments) {
  std::error_code ec;
  fs::create_directories(arguments.output, ec);
  const std::vector<ClipResult> expected =
      arguments.expected.empty() ? std::vector<ClipResult>() : ReadResults(arguments.expected);
  std::vector<ClipResult> results;
  bool is_complete = false;
  {
    Bench bench(arguments);
    is_complete = bench.Run();
    results = bench.results();
  }
  const std::string tables = results.empty() ? "" : ResultTables(results);
  if (!is_complete) {
    std::printf("%s", tables.c_str());
    PrintMessage("error", fmt::format("interrupted after {} clips: they are kept in {}, the same "
                                      "command goes on with the rest",
                                      results.size(), arguments.output.string()));
    return kExitInterrupted;
  }
  Json json = {{"format", "mpc-bench"}, {"version", 1}, {"suite", arguments.suite}};
  for (const ClipResult& result : results) json["clips"].push_back(ResultJson(result));
  mpc::WriteFileAtomically(arguments.output / "results.json", json.dump(1) + "\n");
  mpc::WriteFileAtomically(arguments.output / "results.md", tables);
  std::printf("%s", tables.c_str());
  const std::vector<std::string> regressions = Regressions(results, expected);
  for (const std::string& regression : regressions) PrintMessage("worse", regression);
  if (regressions.empty()) return kExitOk;
  throw mpc::Error(mpc::ErrorCode::kMismatch,
                   fmt::format("{} numbers or clips are worse than {} expects", regressions.size(),
                               arguments.expected.string()));
}

// As the tests and scripts look for it.
fs::path DefaultData() {
  const char* folder = std::getenv("MPC_DATA");
  return folder != nullptr ? folder : "../shared/data";
}

}  // namespace

Command AddBenchCommand(CLI::App* parent) {
  CLI::App* const app =
      parent->add_subcommand("bench", "Measure every stage on clips with known truth");
  const auto arguments = std::make_shared<BenchArguments>();
  arguments->data = DefaultData();
  app->add_option("-o,--output", arguments->output, "Folder for clips and results")->required();
  app->add_option("--suite", arguments->suite, "full, small, or a file of clips")
      ->capture_default_str();
  app->add_option("--noise", arguments->noise,
                  "Errors of the detections of all synthetic clips; default: as the suite says")
      ->check(CLI::IsMember({"exact", "white", "measured"}));
  app->add_option("--data", arguments->data, "Folder of the real clips; default: MPC_DATA");
  app->add_flag("--no-real", arguments->no_real, "Synthetic clips only");
  app->add_flag("--fresh", arguments->fresh, "Do not use what an earlier run left in the folder");
  app->add_option("--expect", arguments->expected,
                  "A results.json: fail when accuracy is worse than there");
  app->add_flag("--quiet", arguments->quiet, "No progress");
  return {app, [arguments] { return Run(*arguments); }};
}

}  // namespace monoperfcap
