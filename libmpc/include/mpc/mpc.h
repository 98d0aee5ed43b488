// Purpose: everything most programs need: mpc::Capture, what it leaves behind, silhouettes
// and refinement.
#pragma once

#include "mpc/capture.h"
#include "mpc/core/error.h"
#include "mpc/detect_clip.h"
#include "mpc/free_view.h"
#include "mpc/refinement.h"
#include "mpc/silhouettes.h"
#include "mpc/skeleton/world.h"
#include "mpc/take.h"
