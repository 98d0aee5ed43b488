// Purpose: a first check of a captured pose: the posed mesh against the networks' mask of the person.
// Units: intersection over union. Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/detect/person_mask.h"
#include "mpc/skeleton/character.h"

namespace mpc::internal {

// IoU of each mask and the mesh at its frame of the poses (N x F, camera frame); F, NaN for frames
// without a mask. Does not depend on num_threads.
std::vector<double> ModelFit(const Character& character, const Camera& camera,
                             const Eigen::MatrixXd& poses, std::span<const PersonMask> masks,
                             int num_threads);

// Warns when the mesh lies somewhere else than the person.
void AddModelFitWarning(std::span<const double> iou, std::vector<std::string>* warnings);

}  // namespace mpc::internal
