// Purpose: the outcome of a solve. A solver never throws for a hard problem.
#pragma once

#include <string>

namespace mpc {

enum class Termination {
  kConverged,      // relative cost decrease below the tolerance
  kMaxIterations,  // still improving when the iterations ran out
  kNoStep,         // no step lowers the cost
  kFailed,         // the start lies outside the energies' domain
};

struct SolveSummary {
  Termination termination = Termination::kConverged;
  double initial_cost = 0;
  double final_cost = 0;
  int iterations = 0;
  double seconds = 0;
};

}  // namespace mpc
