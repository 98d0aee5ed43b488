// Purpose: the output folder, and a captured performance as files.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/io/gltf.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_asset.h"
#include "mpc/skeleton/world.h"

namespace mpc::internal {

inline constexpr const char* kPosesName = "poses.json";
inline constexpr const char* kSurfaceName = "surface.pc2";
inline constexpr const char* kOverlayName = "overlay.mp4";
inline constexpr const char* kReportName = "report.json";

// What the writers need: character and rig with the proportions of the poses (camera frame).
struct Performance {
  const RigAsset& rig;
  const Character& character;
  const Camera& camera;
  const Eigen::MatrixXd& poses;
  const WorldPlacement& world;
  double fps = 0;
};

// All throw Error (kWriteFailed) and leave no half-written file.
//
// surface: a surface.pc2 of the performance, to become morph targets; empty: none.
GltfSurfaceError WritePerformanceGltf(const std::filesystem::path& path,
                                      const std::filesystem::path& actor,
                                      const Performance& performance,
                                      const std::filesystem::path& surface = {},
                                      int frames_per_target = 1);
void WriteMotionBvh(const std::filesystem::path& path, const Performance& performance);
void WriteJointsTrc(const std::filesystem::path& path, const Performance& performance);

// Makes the folder and proves that files can be made there; `names` are what will be written into
// it. Throws Error: kWriteFailed, and kInvalidArgument when one of `inputs` (empty paths are none)
// would be overwritten.
void PrepareOutput(const std::filesystem::path& output,
                   std::span<const std::filesystem::path> inputs,
                   std::span<const char* const> names);

// What the rows of a pose are: "root_tx" to "root_rz", then the hinges.
std::vector<std::string> DofNames(const Skeleton& skeleton);

}  // namespace mpc::internal
