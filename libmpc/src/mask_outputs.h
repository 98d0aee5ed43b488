// Purpose: silhouettes and surfaces as files: masks.mp4, PNGs, the outline over the video,
// surface.pc2.
#pragma once

#include <exception>
#include <filesystem>
#include <string>
#include <vector>

#include "mpc/core/detections.h"
#include "mpc/refinement.h"
#include "mpc/silhouettes.h"
#include "mpc/skeleton/world.h"

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

struct WrittenRefinement {
  ClipRefinement refinement;
  std::exception_ptr overlay_error;  // why there is no overlay, which costs nobody the rest
};

// Refines, and writes masks.mp4, when the surface is refined surface.pc2 (scene frame), and overlay.mp4
// with `detections` unless they are null, into `output`. When the callback stops the work there are
// fewer records than poses and none of the files. Throws Error as RefineClip, and kWriteFailed.
WrittenRefinement WriteRefinement(const std::filesystem::path& output, const WorldPlacement& world,
                                  double fps, const PosedClip& clip,
                                  const ClipRefinementOptions& options,
                                  const Detections2d* detections, const ProgressCallback& progress);

// What a user should look at.
void AddRefinementWarnings(const std::vector<RefinementRecord>& records,
                           std::vector<std::string>* warnings);
void AddSilhouetteWarnings(const std::vector<SilhouetteRecord>& records,
                           std::vector<std::string>* warnings);

}  // namespace mpc::internal
