// Purpose: report.json and silhouettes.json (docs/formats.md, "Report" and "Silhouettes").
#pragma once

#include <filesystem>

#include "mpc/capture.h"
#include "mpc/take.h"

namespace mpc::internal {

// Both write whole or not at all. Throw Error (kWriteFailed).
void WriteReport(const std::filesystem::path& path, const CaptureInputs& inputs,
                 const CaptureOptions& options, const CaptureReport& report);
void WriteSilhouetteReport(const std::filesystem::path& path, const Take& take,
                           const SegmentReport& report);

}  // namespace mpc::internal
