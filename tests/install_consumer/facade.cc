// The installed facade compiles and links.

#include "mpc/mpc.h"

const char* const first_state = mpc::SilhouetteStateName(mpc::SilhouetteState::kCut);
