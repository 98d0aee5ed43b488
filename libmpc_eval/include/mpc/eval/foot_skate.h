// Purpose: how far captured feet slide while the true ones stand.
// Source: ours; the usual measure of foot skate, with contacts taken from the truth.
// Frames: world, the same for both inputs (not that of a moving camera). Units: inputs metres,
// results mm. Symbols: J joints, F frames; trajectories are 3J x F.
#pragma once

#include <Eigen/Core>
#include <span>

#include "mpc/core/joints.h"

namespace mpc {

struct ContactOptions {
  double max_speed = 0.15;   // m/s; the truth moves less from this frame to the next; ours
  double max_height = 0.05;  // m above the lowest place of the joint in the clip; ours
};

struct FootSkate {
  double mean_mm = 0;            // per contact; NaN when there is none
  int num_contacts = 0;          // pairs of successive frames in which an ankle or toe tip stands
  int num_frames = 0;            // frames with a contact
  Eigen::VectorXd per_frame_mm;  // F: from this frame to the next; NaN without contact
};

// Ankles and toe tips each on their own: where the truth stands from one frame to the next, the
// length of the horizontal part of the estimate's step less the truth's. `up` is a unit vector.
// Joints that are not listed, or missing (NaN) in either input, make no contact. Throws Error:
// kMismatch for sizes, kInvalidArgument for fps <= 0 or an `up` that is not of length 1.
FootSkate CompareFootSkate(std::span<const JointId> joints, const Eigen::MatrixXd& estimate,
                           const Eigen::MatrixXd& truth, double fps, const Eigen::Vector3d& up,
                           const ContactOptions& options = {});

}  // namespace mpc
