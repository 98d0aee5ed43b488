// Purpose: an evaluation as lines of numbers, each with what was scored, how it was aligned and over
// which frames: on the console, as JSON, and in the HTML page.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "evaluation.h"

namespace monoperfcap {

// One number.
struct Score {
  std::string key;    // in JSON, such as "pa_mpjpe"
  std::string field;  // in JSON, such as "mean_mm"
  std::string label;  // for people
  double value = 0;   // NaN: nothing was scored
  std::string unit;
  std::string scored;     // joints, vertices or pixels
  std::string alignment;  // what was removed first
  int num_frames = 0;     // that were scored
};

// What there is of an evaluation, in the order of the table.
std::vector<Score> Scores(const Evaluation& evaluation);

// The value of a key, NaN when there is none.
double ScoreValue(const std::vector<Score>& scores, const std::string& key);

// "61.23", or "-" for what does not exist.
std::string ValueText(const Score& score);

// A line per score, then what was skipped and the joints' names.
std::string EvaluationText(const Evaluation& evaluation);

// docs/formats.md, "Evaluation".
nlohmann::ordered_json EvaluationJson(const Evaluation& evaluation);

// A number, or null for what is not finite.
nlohmann::ordered_json NumberJson(double value);

}  // namespace monoperfcap
