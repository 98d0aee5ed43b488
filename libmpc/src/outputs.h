// Purpose: a captured performance as files.
#pragma once

#include <Eigen/Core>
#include <filesystem>

#include "mpc/core/camera.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_asset.h"
#include "mpc/world.h"

namespace mpc::internal {

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
void WritePerformanceGltf(const std::filesystem::path& path, const std::filesystem::path& actor,
                          const Performance& performance);
void WriteMotionBvh(const std::filesystem::path& path, const Performance& performance);
void WriteJointsTrc(const std::filesystem::path& path, const Performance& performance);

}  // namespace mpc::internal
