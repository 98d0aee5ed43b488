// Purpose: everything most programs need: mpc::Capture, its inputs, options and report.
#pragma once

#include "mpc/capture.h"
#include "mpc/core/error.h"
#include "mpc/world.h"
