// Purpose: everything most programs need: mpc::Capture, what it leaves behind, and silhouettes.
#pragma once

#include "mpc/capture.h"
#include "mpc/core/error.h"
#include "mpc/detect_clip.h"
#include "mpc/silhouettes.h"
#include "mpc/skeleton/world.h"
#include "mpc/take.h"
