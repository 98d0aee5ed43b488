// Purpose: silhouettes as files: masks.mp4, PNGs, the outline over the video.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mpc/silhouettes.h"

namespace mpc::internal {

inline constexpr const char* kMasksName = "masks.mp4";
inline constexpr const char* kMaskFolderName = "masks";

struct MaskOutputs {
  std::filesystem::path video;
  std::filesystem::path pictures = {};  // a folder; empty: none
  std::filesystem::path overlay = {};   // empty: none
};

// Extracts and writes. When the callback stops the work there are fewer records than poses and none
// of the files. Throws Error as ExtractSilhouettes, and kWriteFailed.
std::vector<SilhouetteRecord> WriteMasks(const MaskOutputs& outputs, double fps,
                                         const PosedClip& clip, const SilhouetteOptions& options,
                                         const ProgressCallback& progress);

// What a user should look at.
void AddSilhouetteWarnings(const std::vector<SilhouetteRecord>& records,
                           std::vector<std::string>* warnings);

}  // namespace mpc::internal
