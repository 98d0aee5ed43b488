// What a clip's detections weigh.
#include "mpc/pose/clip_evidence.h"

#include <gtest/gtest.h>

#include "mpc/pose/frame_solver.h"
#include "pose/synthetic_clip.h"

namespace mpc {
namespace {

using testing::MakeClip;
using testing::SyntheticClip;

// Cost of the 3D bones and of the rest prior, as squares, in a pose that is off.
struct Costs {
  double bones = 0;
  double rest = 0;
};

Costs CostsOf(const SyntheticClip& clip, const ClipEvidence& evidence) {
  const Eigen::VectorXd pose = clip.poses.col(5);
  const FrameProblem problem =
      evidence.MakeProblem(evidence.Observe(0), 4, 0, RelaxedPose(clip.skeleton));
  FrameSolveScratch scratch;
  PosePoint& at = scratch.current;
  at.pose = pose;
  at.root_rotation = ExpSO3(pose.segment<3>(3));
  at.Update(clip.skeleton, /*with_jacobian=*/false);
  const auto cost = [&](auto energy) {
    Eigen::VectorXd residuals(energy.num_residuals());
    energy.Evaluate(at, 0, &residuals, nullptr);
    return residuals.squaredNorm();
  };
  return {cost(problem.bone_vectors), cost(problem.rest_prior)};
}

double BonesLeft(double error_3d_mm) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 20, 30, {}, 1);
  PoseOptions options = testing::PlainOptions();
  options.error_3d_mm = error_3d_mm;
  options.lasting_discount = 3;
  ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                        &clip.detections.detections3d, clip.fps, options);
  const Costs before = CostsOf(clip, evidence);
  evidence.DiscountLasting();
  const Costs after = CostsOf(clip, evidence);
  EXPECT_GT(before.bones, 0);
  EXPECT_NEAR(after.rest, before.rest / 3, 1e-9 * before.rest);
  return after.bones / before.bones;
}

TEST(ClipEvidenceTest, LargeErrorsThatLastAreDiscountedSmallOnesAreNot) {
  EXPECT_NEAR(BonesLeft(20), 1, 1e-9);
  EXPECT_NEAR(BonesLeft(40), 1 / 4.0, 1e-9);  // errors count as twice as large
  EXPECT_NEAR(BonesLeft(60), 1 / 9.0, 1e-9);
  EXPECT_NEAR(BonesLeft(100), 1 / 9.0, 1e-9);
}

TEST(ClipEvidenceTest, WithoutThe3dNothingIsDiscounted) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 20, 30, {}, 1);
  ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d, nullptr, clip.fps,
                        testing::PlainOptions());
  const Costs before = CostsOf(clip, evidence);
  evidence.DiscountLasting();
  EXPECT_EQ(CostsOf(clip, evidence).rest, before.rest);
}

}  // namespace
}  // namespace mpc
