// Purpose: what a joint detector would have seen of a known performance, with errors of a known
// kind: exact truth for tests, benchmarks and the demo.
// Source: ours. The "measured" kind follows a network's errors on real clips: biases in depth that
// last for a second, and limbs whose depth is reversed.
// Frames: camera frame (x right, y down, z forward); the "ray frame" has z along the viewing ray
// through the person. Units: metres, pixels; error sizes in mm and px.
// Symbols: N dofs, F frames, J joints.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

// Frames [begin, end).
struct FrameRange {
  int begin = 0;
  int end = 0;
};

struct DetectionNoise {
  double sigma_px = 0;          // white, per axis
  double sigma_mm = 0;          // white, per axis
  double outlier_fraction = 0;  // of 2D and of 3D joints, each on its own, in [0, 1]
  double outlier_px = 150;      // sigma of an outlier, per axis
  double outlier_mm = 400;
  double dropped_fraction = 0;    // joints not seen at all, in 2D and 3D together, in [0, 1]
  double bias_along_ray_mm = 0;   // slowly varying error per joint, root mean square
  double bias_across_ray_mm = 0;  // root mean square length of its two axes together
  double bias_correlation_s = 1;  // integral of its autocorrelation over positive lags
  double reversed_fraction = 0;   // of the time some limb has its depth reversed, in [0, 1]
  double reversal_min_s = 0.3;    // how long one limb stays reversed
  double reversal_max_s = 1.0;
  double swapped_fraction = 0;   // frames whose left and right are exchanged, in [0, 1]
  std::vector<FrameRange> gaps;  // nothing is seen

  // sigma, outliers and drops only.
  static DetectionNoise White(double sigma_px, double sigma_mm, double outlier_fraction,
                              double dropped_fraction);
  // 90 mm along and 45 mm across the ray for a second at a time, half of the time one limb
  // reversed, 3 px in the picture, 8 mm of jitter.
  static DetectionNoise Measured();
  // The same with the rarer failures of networks: 1 % outliers, 3 % of the joints not seen, left and
  // right exchanged in 2 % of the frames.
  static DetectionNoise MeasuredWithFailures();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

struct SyntheticDetections {
  Detections2d detections2d;
  Detections3d detections3d;    // ray-aligned, relative to the middle of the hips
  std::vector<JointId> joints;  // J: the skeleton's first 16
  Eigen::MatrixXd truth;        // 3J x F, camera frame
};

// Detections of the 16 joints of poses in the camera frame. Joints outside the picture or behind
// the camera have no 2D detection. The ray of a frame passes through the middle of the hips. Same
// arguments, same bytes. Throws Error (kInvalidArgument) for wrong sizes or noise.
SyntheticDetections SynthesizeDetections(const Skeleton& skeleton,
                                         const Eigen::MatrixXd& poses_in_camera,
                                         const Camera& camera, double fps,
                                         const DetectionNoise& noise, uint64_t seed);

// Detections without any error.
inline SyntheticDetections PerfectDetections(const Skeleton& skeleton,
                                             const Eigen::MatrixXd& poses_in_camera,
                                             const Camera& camera, double fps) {
  return SynthesizeDetections(skeleton, poses_in_camera, camera, fps, {}, 0);
}

}  // namespace mpc
