// Purpose: what the commands say about silhouettes.
#pragma once

#include <string>
#include <vector>

#include "mpc/silhouettes.h"

namespace monoperfcap {

// Lines of text: how the silhouettes came about, and how they compare with true masks if there are
// any. Empty without silhouettes.
std::string SilhouetteSummary(const std::vector<mpc::SilhouetteRecord>& records);

}  // namespace monoperfcap
