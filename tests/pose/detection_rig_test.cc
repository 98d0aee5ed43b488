#include "mpc/pose/detection_rig.h"

#include <gtest/gtest.h>

#include "pose/synthetic_clip.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using testing::SyntheticClip;

constexpr int kNumFrames = 12;

PoseOptions RigOptions() {
  PoseOptions options = PoseOptions::Paper();
  options.weight_rest = 0.01;
  return options;
}

Eigen::MatrixXd Rig(const SyntheticClip& clip) {
  return RigDetections(ClipEvidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                                    &clip.detections.detections3d, clip.fps, RigOptions()));
}

TEST(DetectionRigTest, FindsThePosesOfPerfectDetections) {
  for (const MotionKind kind : {MotionKind::kTurn, MotionKind::kReach}) {
    const SyntheticClip clip = testing::MakeClip(kind, kNumFrames, 10, {}, 1);
    const Eigen::MatrixXd poses = Rig(clip);
    EXPECT_LT(testing::FrameErrors(clip, clip.skeleton, poses).maxCoeff(), 12);
    EXPECT_LT((poses.topRows<3>() - clip.poses.topRows<3>()).colwise().norm().maxCoeff(), 0.05);
  }
}

TEST(DetectionRigTest, FollowsTheDetectionIntoItsErrors) {
  SyntheticClip clip = testing::MakeClip(MotionKind::kReach, kNumFrames, 10, {}, 1);
  DetectionNoise noise;
  noise.sigma_mm = 60;
  clip.detections = SynthesizeDetections(clip.skeleton, clip.poses, clip.camera, 10, noise, 3);
  EXPECT_GT(testing::FrameErrors(clip, clip.skeleton, Rig(clip)).mean(), 30);
}

TEST(DetectionRigTest, FramesWithoutDetectionsRepeatTheirNeighbour) {
  SyntheticClip clip = testing::MakeClip(MotionKind::kReach, kNumFrames, 10, {}, 1);
  for (const int f : {0, 1, 5}) {
    clip.detections.detections3d.frames[f].confidence.setZero();
    clip.detections.detections2d.frames[f].confidence.setZero();
  }
  const Eigen::MatrixXd poses = Rig(clip);
  EXPECT_TRUE(poses.allFinite());
  EXPECT_EQ(poses.col(0), poses.col(2));
  EXPECT_EQ(poses.col(5), poses.col(4));
  for (auto& frame : clip.detections.detections3d.frames) frame.confidence.setZero();
  EXPECT_MPC_ERROR(Rig(clip), kMismatch, "no 3D detection");
}

}  // namespace
}  // namespace mpc
