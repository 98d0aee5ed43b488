// Purpose: what the benchmark found: numbers per clip and stage, as tables for people, as JSON, and
// against the numbers of an earlier run.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "evaluation.h"

namespace monoperfcap {

// Column key to value; NaN for what the clip's truth does not allow.
using Row = std::map<std::string, double>;

struct ClipResult {
  std::string name;
  bool is_real = false;
  int num_frames = 0;
  double fps = 0;
  std::map<std::string, Row> stages;  // by key
  // Of a synthetic clip: numbers that change when the clip itself does.
  Row fingerprint;
};

struct Column {
  const char* key;
  const char* title;
  const char* unit;
  int decimals;
  // What a regression may lose before it counts: a share of the expected value and a step more.
  // Negative for columns where more is better; 0 and 0: not compared.
  double worse_share;
  double worse_step;
  double (*value)(const Evaluation& evaluation, double seconds_per_frame);
};
std::span<const Column> Columns();

Row MakeRow(const Evaluation& evaluation, double seconds_per_frame);

// The ablation table over the synthetic and over the real clips, then one line per clip for the last
// stage that exists; in Markdown, which reads well on a console too.
std::string ResultTables(const std::vector<ClipResult>& results);

// One sentence per clip and stage that has more vertex error (by over 1 mm) or less IoU (by over 0.005)
// than the stage it starts from.
std::vector<std::string> WorseSteps(const std::vector<ClipResult>& results);

nlohmann::ordered_json ResultJson(const ClipResult& result);
// Throws nlohmann::json::exception for another layout.
ClipResult ParseResult(const nlohmann::json& json);

// One sentence per number that is worse than expected beyond the column's tolerance, per clip that
// is not there, and per clip that is not the one of before.
std::vector<std::string> Regressions(const std::vector<ClipResult>& results,
                                     const std::vector<ClipResult>& expected);

}  // namespace monoperfcap
