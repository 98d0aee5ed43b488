#include "bench_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "bench_stages.h"
#include "evaluation_table.h"
#include "mpc/core/units.h"

namespace monoperfcap {
namespace {

using Json = nlohmann::ordered_json;

// What a step of the method may lose on a clip.
constexpr double kWorseVertexMm = 1;
constexpr double kWorseIou = 0.005;
constexpr double kFingerprintTolerance = 1e-3;  // relative; machines differ by less

constexpr std::array<Column, 7> kColumns = {{
    {"mpjpe", "MPJPE", "mm", 1, 0.05, 0.5,
     [](const Evaluation& e, double) { return e.errors.root.mean_mm; }},
    {"pa_mpjpe", "PA-MPJPE", "mm", 1, 0.05, 0.5,
     [](const Evaluation& e, double) { return e.errors.similarity.mean_mm; }},
    {"vertex_error", "vertex error", "mm", 1, 0.05, 0.5,
     [](const Evaluation& e, double) {
       return e.surface ? e.surface->vertex_mm.mean() : mpc::kNan;
     }},
    {"iou", "IoU", "", 3, -0.005, 0,
     [](const Evaluation& e, double) { return e.model ? e.model->iou.mean() : mpc::kNan; }},
    {"jitter", "jitter", "m/s^2", 2, 0.05, 0.05,
     [](const Evaluation& e, double) { return e.jitter.mean_mm_per_s2 / 1000; }},
    {"foot_skate", "foot skate", "mm/frame", 2, 0.1, 0.2,
     [](const Evaluation& e, double) { return e.skate ? e.skate->mean_mm : mpc::kNan; }},
    {"seconds", "time", "s/frame", 4, 0, 0,
     [](const Evaluation&, double seconds) { return seconds; }},
}};

double Value(const Row& row, const std::string& key) {
  const auto it = row.find(key);
  return it == row.end() ? mpc::kNan : it->second;
}

std::string Cell(double value, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : "-";
}

std::string Header(const std::string& first) {
  std::string line = fmt::format("| {} |", first), rule = "|---|";
  for (const Column& column : kColumns) {
    const bool has_unit = *column.unit != 0;
    line += has_unit ? fmt::format(" {} ({}) |", column.title, column.unit)
                     : fmt::format(" {} |", column.title);
    rule += "---:|";
  }
  return line + "\n" + rule + "\n";
}

std::string TableLine(const std::string& name, const Row& row) {
  std::string line = fmt::format("| {} |", name);
  for (const Column& column : kColumns) {
    line += fmt::format(" {} |", Cell(Value(row, column.key), column.decimals));
  }
  return line + "\n";
}

// Mean over the clips that have the number.
Row MeanRow(const std::vector<const ClipResult*>& clips, const std::string& stage) {
  Row mean;
  for (const Column& column : kColumns) {
    double sum = 0;
    int count = 0;
    for (const ClipResult* clip : clips) {
      const auto it = clip->stages.find(stage);
      const double value = it == clip->stages.end() ? mpc::kNan : Value(it->second, column.key);
      if (std::isfinite(value)) sum += value, ++count;
    }
    mean[column.key] = count > 0 ? sum / count : mpc::kNan;
  }
  return mean;
}

const Stage& LastStage() { return Stages().back(); }

std::string Ablation(const std::string& title, const std::vector<const ClipResult*>& clips) {
  if (clips.empty()) return "";
  int num_frames = 0;
  for (const ClipResult* clip : clips) num_frames += clip->num_frames;
  std::string text =
      fmt::format("{}: mean over {} clips ({} frames)\n\n", title, clips.size(), num_frames) +
      Header("stage");
  for (const Stage& stage : Stages()) text += TableLine(stage.name, MeanRow(clips, stage.key));
  return text + "\n";
}

std::string RowDifferences(const Row& row, const Row& expected, const std::string& place) {
  std::string text;
  for (const Column& column : kColumns) {
    const double now = Value(row, column.key), before = Value(expected, column.key);
    if (!std::isfinite(before) || (column.worse_share == 0 && column.worse_step == 0)) continue;
    const double limit = before * (1 + column.worse_share) + column.worse_step;
    const bool is_good = column.worse_share < 0 ? now >= limit : now <= limit;  // false for NaN
    if (!is_good) {
      text += fmt::format("{}{}: {} {} is {}, was {}, limit {}", text.empty() ? "" : "; ", place,
                          column.title, column.unit, Cell(now, column.decimals + 1),
                          Cell(before, column.decimals + 1), Cell(limit, column.decimals + 1));
    }
  }
  return text;
}

Json RowJson(const Row& row) {
  Json json = Json::object();
  for (const auto& [key, value] : row) json[key] = NumberJson(value);
  return json;
}

Row ParseRow(const nlohmann::json& json) {
  Row row;
  for (const auto& [key, value] : json.items()) {
    row[key] = value.is_null() ? mpc::kNan : value.get<double>();
  }
  return row;
}

}  // namespace

std::span<const Column> Columns() { return kColumns; }

Row MakeRow(const Evaluation& evaluation, double seconds_per_frame) {
  Row row;
  for (const Column& column : kColumns) {
    row[column.key] = column.value(evaluation, seconds_per_frame);
  }
  return row;
}

std::string ResultTables(const std::vector<ClipResult>& results) {
  std::vector<const ClipResult*> synthetic, real;
  for (const ClipResult& result : results) (result.is_real ? real : synthetic).push_back(&result);
  std::string text = Ablation("Synthetic clips", synthetic) + Ablation("Real clips", real);
  text += fmt::format("Per clip, stage: {}\n\n", LastStage().name) + Header("clip");
  for (const ClipResult& result : results) {
    const auto it = result.stages.find(LastStage().key);
    if (it == result.stages.end()) continue;
    text += TableLine(
        fmt::format("{} ({} frames, {:.4g} fps)", result.name, result.num_frames, result.fps),
        it->second);
  }
  text += fmt::format("\nSteps at which a clip gets worse by more than {} mm or {} of IoU:\n\n",
                      kWorseVertexMm, kWorseIou);
  const std::vector<std::string> worse = WorseSteps(results);
  for (const std::string& step : worse) text += "- " + step + "\n";
  if (worse.empty()) text += "none\n";
  return text +
         "\nMPJPE and PA-MPJPE: 14 joints, all frames with truth, aligned by root translation and "
         "by "
         "a similarity per frame. Vertex error: one translation per clip. IoU: posed mesh against "
         "true masks. Jitter: second difference of the joints, in the world. Foot skate: ankles "
         "and "
         "toes while the true ones stand. Time: processor time of all threads, from the detections "
         "on.\n";
}

Json ResultJson(const ClipResult& result) {
  Json stages = Json::object();
  for (const auto& [key, row] : result.stages) stages[key] = RowJson(row);
  return {{"name", result.name},         {"real", result.is_real},
          {"frames", result.num_frames}, {"fps", result.fps},
          {"stages", std::move(stages)}, {"fingerprint", RowJson(result.fingerprint)}};
}

ClipResult ParseResult(const nlohmann::json& json) {
  ClipResult result;
  result.name = json.at("name").get<std::string>();
  result.is_real = json.at("real").get<bool>();
  result.num_frames = json.at("frames").get<int>();
  result.fps = json.at("fps").get<double>();
  for (const auto& [key, row] : json.at("stages").get<std::map<std::string, nlohmann::json>>()) {
    result.stages[key] = ParseRow(row);
  }
  result.fingerprint = ParseRow(json.at("fingerprint"));
  return result;
}

std::vector<std::string> WorseSteps(const std::vector<ClipResult>& results) {
  std::vector<std::string> worse;
  for (const ClipResult& result : results) {
    for (const Stage& stage : Stages()) {
      const auto after = result.stages.find(stage.key), before = result.stages.find(stage.improves);
      if (after == result.stages.end() || before == result.stages.end()) continue;
      const auto change = [&](const char* key) {  // NaN where there is no truth
        return Value(after->second, key) - Value(before->second, key);
      };
      const double vertex_mm = change("vertex_error"), iou = change("iou");
      if (vertex_mm > kWorseVertexMm || iou < -kWorseIou) {
        const std::string vertex =
            std::isnan(vertex_mm) ? "" : fmt::format("vertex error {:+.1f} mm, ", vertex_mm);
        worse.push_back(fmt::format("{}, {}: {}IoU {:+.3f}", result.name, stage.name, vertex, iou));
      }
    }
  }
  return worse;
}

std::vector<std::string> Regressions(const std::vector<ClipResult>& results,
                                     const std::vector<ClipResult>& expected) {
  std::vector<std::string> regressions;
  for (const ClipResult& before : expected) {
    const auto now = std::find_if(results.begin(), results.end(),
                                  [&](const ClipResult& r) { return r.name == before.name; });
    if (now == results.end()) {
      regressions.push_back(fmt::format("{}: no such clip any more", before.name));
      continue;
    }
    for (const auto& [key, value] : before.fingerprint) {
      const double found = Value(now->fingerprint, key);
      if (!(std::abs(found - value) <= kFingerprintTolerance * std::abs(value))) {
        regressions.push_back(fmt::format("{}: the clip is another one: {} is {:.6g}, was {:.6g}",
                                          before.name, key, found, value));
      }
    }
    for (const auto& [key, row] : before.stages) {
      const auto stage = now->stages.find(key);
      const std::string differences = RowDifferences(
          stage == now->stages.end() ? Row{} : stage->second, row, before.name + ", " + key);
      if (!differences.empty()) regressions.push_back(differences);
    }
  }
  return regressions;
}

}  // namespace monoperfcap
