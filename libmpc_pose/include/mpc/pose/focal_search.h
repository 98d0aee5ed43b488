// Purpose: the focal length of a camera of which nothing is known, from the person it shows.
// Source: ours (docs/detect.md, "Unknown camera"): some frames are solved for several focal
// lengths; the residuals of a body of known size and what cameras usually have decide.
// Units: pixels. Symbols: F frames.
#pragma once

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/core/progress.h"
#include "mpc/pose/pose_options.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

struct FocalEstimate {
  double focal_px = 0;
  double relative_sigma = 0;  // standard deviation of its logarithm
};

// Field of view of the longer side that is taken as usual: a phone's main camera when it films.
inline constexpr double kUsualFovRad = 1.047;  // 60 degrees

// What is known of it without the person.
struct FocalPrior {
  double focal_px = 0;
  double relative_sigma = 0;  // standard deviation of its logarithm, above 0

  // kUsualFovRad, 46 to 77 degrees within one standard deviation.
  static FocalPrior Usual(int width, int height);
};

// One focal length for the clip; the principal point is the middle of a picture of width x height.
// detections3d may be null. Reports progress as stage "focal"; a callback that says false ends the
// search with what is known by then. Throws Error as EstimatePoses, and kInvalidArgument
// for a prior without a positive size and spread. Does not depend on options.num_threads.
FocalEstimate EstimateFocal(const Skeleton& skeleton, int width, int height,
                            const Detections2d& detections2d, const Detections3d* detections3d,
                            double fps, const PoseOptions& options, const FocalPrior& prior,
                            const ProgressCallback& progress = {});

}  // namespace mpc
