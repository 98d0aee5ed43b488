// Purpose: the networks, for tests that run them.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>

#include "mpc/detect/models.h"

// First line of a test that runs the networks: skips loudly when they are not there.
#define MPC_REQUIRE_MODELS()                                                              \
  if (!std::filesystem::exists(mpc::DefaultModelFolder() / "pose_landmark_heavy.tflite")) \
  GTEST_SKIP() << "needs the networks: run scripts/get_models.sh"
