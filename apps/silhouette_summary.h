// Purpose: what the commands say about silhouettes and refinement.
#pragma once

#include <string>
#include <vector>

#include "mpc/refinement.h"

namespace monoperfcap {

// Lines of text: how the silhouettes came about, and how they compare with true masks if there are
// any. Empty without silhouettes.
std::string SilhouetteSummary(const std::vector<mpc::SilhouetteRecord>& records);

// The same, and how far pose and surface were refined.
std::string RefinementSummary(const std::vector<mpc::RefinementRecord>& records);

}  // namespace monoperfcap
