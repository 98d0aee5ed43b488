// Purpose: a clip with known truth, its detections, and the error of an estimate.
// Frames: camera frame. Units: metres, errors mm.
#pragma once

#include <Eigen/Core>

#include "mpc/eval/metrics.h"
#include "mpc/eval/synthetic.h"
#include "mpc/pose/pose_estimator.h"
#include "mpc/skeleton/kinematics.h"
#include "pose/synthetic_batch.h"

namespace mpc::testing {

struct SyntheticClip {
  Skeleton skeleton = DefaultSkeleton();  // the performer's own
  Camera camera = SyntheticCamera();
  double fps = 30;
  Eigen::MatrixXd poses;  // N x F
  SyntheticDetections detections;

  int num_frames() const { return static_cast<int>(poses.cols()); }
};

inline SyntheticClip MakeClip(MotionKind kind, int num_frames, double fps,
                              const DetectionNoise& noise, uint64_t seed,
                              const Skeleton& skeleton = DefaultSkeleton()) {
  SyntheticClip clip;
  clip.skeleton = skeleton;
  clip.fps = fps;
  clip.poses = MotionInCamera(skeleton, kind, num_frames, fps);
  clip.detections = SynthesizeDetections(skeleton, clip.poses, clip.camera, fps, noise, seed);
  return clip;
}

inline PoseTrack Estimate(const SyntheticClip& clip, const PoseOptions& options) {
  return EstimatePoses(clip.skeleton, clip.camera, clip.detections.detections2d,
                       &clip.detections.detections3d, clip.fps, options);
}

// Root-aligned error of every frame over the 16 joints of poses of `skeleton`, F.
inline Eigen::VectorXd FrameErrors(const SyntheticClip& clip, const Skeleton& skeleton,
                                   const Eigen::MatrixXd& poses) {
  const Eigen::MatrixXd joints = JointTrajectories(skeleton, poses).topRows<3 * kNumPaperJoints>();
  return CompareJoints(clip.detections.joints, joints, clip.detections.truth).root.per_frame_mm;
}

// Plain options of one run: no calibration, one thread.
inline PoseOptions PlainOptions() {
  PoseOptions options;
  options.fit_proportions = false;
  options.num_threads = 1;
  return options;
}

}  // namespace mpc::testing
