// Purpose: the option --threads that several commands have.
#pragma once

#include <CLI/CLI.hpp>

namespace monoperfcap {

// Adds it; 0, all cores, if not given. A number given holds for OpenCV's own threads as well.
void AddThreadsOption(CLI::App* app, int* num_threads);

}  // namespace monoperfcap
