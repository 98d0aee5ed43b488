// What a clip's detections weigh.
#include "mpc/pose/clip_evidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

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

Costs CostsOf(const SyntheticClip& clip, const ClipEvidence& evidence, double loss_width = 0) {
  const Eigen::VectorXd pose = clip.poses.col(5);
  const FrameProblem problem =
      evidence.MakeProblem(evidence.Observe(0), 4, loss_width, RelaxedPose(clip.skeleton));
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

TEST(ClipEvidenceTest, FarFromRestCostsNoMoreThanSomeSpreads) {
  SyntheticClip clip = MakeClip(MotionKind::kWalk, 20, 30, {}, 1);
  clip.poses.bottomRows(clip.poses.rows() - 6).array() += 2;  // rad, every hinge
  PoseOptions options = testing::PlainOptions();
  options.weight_rest = 1;
  options.robust_rest = 1.5;
  const ClipEvidence robust(clip.skeleton, clip.camera, clip.detections.detections2d, nullptr,
                            clip.fps, options);
  options.robust_rest = 0;
  const ClipEvidence plain(clip.skeleton, clip.camera, clip.detections.detections2d, nullptr,
                           clip.fps, options);
  const double most = 1.5 * 1.5 * kNoiseCost * static_cast<double>(clip.skeleton.hinges.size());
  EXPECT_LT(CostsOf(clip, robust, 1).rest, most);
  EXPECT_GT(CostsOf(clip, robust, 1).rest, most / 2);
  EXPECT_GT(CostsOf(clip, plain, 1).rest, 2 * most);
  // Plain squares where everything is.
  EXPECT_EQ(CostsOf(clip, robust, 0).rest, CostsOf(clip, plain, 1).rest);
}

TEST(ClipEvidenceTest, WithoutThe3dNothingIsDiscounted) {
  const SyntheticClip clip = MakeClip(MotionKind::kWalk, 20, 30, {}, 1);
  ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d, nullptr, clip.fps,
                        testing::PlainOptions());
  const Costs before = CostsOf(clip, evidence);
  evidence.DiscountLasting();
  EXPECT_EQ(CostsOf(clip, evidence).rest, before.rest);
}

// What 2D points weigh at the end, when each lies off where its joint is seen by the same way in all frames,
// or by one that changes its sign from frame to frame.
double Weight2d(double lasting_mm, double white_mm) {
  SyntheticClip clip = MakeClip(MotionKind::kWalk, 40, 30, {}, 1);
  KinematicState state;
  Detections2d& detections = clip.detections.detections2d;
  for (Eigen::Index f = 0; f < clip.poses.cols(); ++f) {
    ForwardKinematics(clip.skeleton, clip.poses.col(f), &state);
    const double px_per_mm = clip.camera.fx / (1000 * clip.poses(2, f));
    const double off_px = (lasting_mm + (f % 2 == 0 ? 1 : -1) * white_mm) * px_per_mm;
    Detections2d::Frame& frame = detections.frames[static_cast<size_t>(f)];
    for (size_t i = 0; i < detections.joints.size(); ++i) {
      const int joint = clip.skeleton.FindJointIndex(detections.joints[i]);
      Eigen::Vector2d pixel;
      if (joint < 0 || !Project(clip.camera, state.joints.col(joint), &pixel)) continue;
      frame.pixels.col(static_cast<Eigen::Index>(i)) = pixel + Eigen::Vector2d::Constant(off_px);
    }
  }
  ClipEvidence evidence(clip.skeleton, clip.camera, detections, nullptr, clip.fps,
                        testing::PlainOptions());
  const auto cost = [&] {
    const FrameProblem problem =
        evidence.MakeProblem(evidence.Observe(0), 4, 0, RelaxedPose(clip.skeleton));
    FrameSolveScratch scratch;
    PosePoint& at = scratch.current;
    at.pose = clip.poses.col(5);
    at.root_rotation = ExpSO3(at.pose.segment<3>(3));
    at.Update(clip.skeleton, /*with_jacobian=*/false);
    Eigen::VectorXd residuals(problem.reprojection.num_residuals());
    problem.reprojection.Evaluate(at, 0, &residuals, nullptr);
    return residuals.squaredNorm();
  };
  const double before = cost();  // of an error of 20 mm
  std::vector<FrameObservation> observations;
  for (int f = 0; f < evidence.num_frames(); ++f) observations.push_back(evidence.Observe(f));
  evidence.MeasureError2d(observations, clip.poses);
  return cost() / before;
}

TEST(ClipEvidenceTest, PointsWeighByWhatTheirResidualsSay) {
  const double axis = std::sqrt(2 / 1.386);  // as the size of normal errors that would look like it
  const auto expected = [](double error_mm) { return std::pow(20 / error_mm, 2); };
  EXPECT_NEAR(Weight2d(0, 0) / expected(2), 1, 1e-9);    // nothing is better
  EXPECT_NEAR(Weight2d(0.1, 0) / expected(2), 1, 1e-9);  // 12 times as much, but no less than 2
  EXPECT_NEAR(Weight2d(0.5, 0) / expected(12 * 0.5 * axis), 1, 0.02);
  EXPECT_NEAR(Weight2d(3, 0), 1, 1e-9);  // 20 mm and no more
  EXPECT_NEAR(Weight2d(0, 6) / expected(1.35 * 6 * axis), 1, 0.02);
  EXPECT_NEAR(Weight2d(0, 1) / expected(2), 1, 1e-9);
}

}  // namespace
}  // namespace mpc
