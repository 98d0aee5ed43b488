// Purpose: the body proportions of the person in the clip, estimated once per clip.
// Source: ours (docs/pose.md, "Proportions"): the paper's template has the actor's own proportions.
// Scales and the poses of whole windows are solved together (Gauss-Newton, the poses eliminated),
// with a prior at the rig's own lengths and its stature kept.
// Units: scales without unit, relative to the rig. Symbols: N dofs, F frames, P body parts.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "mpc/pose/clip_evidence.h"
#include "mpc/pose/frame_initializer.h"
#include "mpc/pose/windows.h"
#include "mpc/skeleton/proportions.h"

namespace mpc {

// Standard deviation of each part's scale, relative, from the curvature of the cost; about the
// prior's where the clip says nothing.
struct ProportionsUncertainty {
  std::array<double, kNumBodyParts> part{};
};

// Estimates the parts' scales step by step, between the rounds in which windows are solved. The
// overall scale stays 1 and the stature, from ankles to head top, the rig's: one camera cannot tell a
// large person far away from a small one near by.
class ProportionsCalibration {
 public:
  explicit ProportionsCalibration(const Skeleton& rig);

  // One Gauss-Newton step of the scales, from `poses` (N x F) that solve the windows for the scales so
  // far. `evidence` and `initialization` are those of the skeleton so far and become those of the new
  // one. Draws on up to eight windows spread over the clip; the result does not depend on num_threads.
  void Step(const std::vector<Window>& windows, const Eigen::MatrixXd& poses, int num_threads,
            ClipEvidence* evidence, FrameInitialization* initialization);

  Proportions proportions() const;
  const ProportionsUncertainty& uncertainty() const { return uncertainty_; }

 private:
  using PartVector = Eigen::Matrix<double, kNumBodyParts, 1>;

  Skeleton Scaled(const PartVector& log_scale) const;
  double LogStature(const PartVector& log_scale) const;

  Skeleton rig_;
  PartVector log_scale_ = PartVector::Zero();
  ProportionsUncertainty uncertainty_;
};

}  // namespace mpc
