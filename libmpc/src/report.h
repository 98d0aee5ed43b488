// Purpose: report.json (docs/formats.md, "Report").
#pragma once

#include <filesystem>

#include "mpc/capture.h"

namespace mpc::internal {

// Writes the report whole or not at all. Throws Error (kWriteFailed).
void WriteReport(const std::filesystem::path& path, const CaptureInputs& inputs,
                 const CaptureOptions& options, const CaptureReport& report);

}  // namespace mpc::internal
