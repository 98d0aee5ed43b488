// Purpose: an evaluation as one HTML page that needs nothing but itself.
#pragma once

#include <string>
#include <vector>

#include "evaluation.h"
#include "worst_frames.h"

namespace monoperfcap {

// Table, plots over time, bars per joint, and the pictures, all inside the text.
std::string EvaluationPage(const Evaluation& evaluation, const std::vector<FramePicture>& pictures);

}  // namespace monoperfcap
