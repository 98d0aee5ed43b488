// A second in which nothing is seen: how soon the errors are back, and how soon they can be.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdio>
#include <iterator>
#include <random>

#include "mpc/core/rigid.h"
#include "mpc/pose/root_chart.h"
#include "mpc/pose/trajectory_basis.h"
#include "pose/synthetic_clip.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using testing::FrameErrors;
using testing::MakeClip;
using testing::SyntheticClip;

constexpr double kClipFps = 30;
constexpr int kClipFrames = 75;
constexpr FrameRange kGap = {25, 55};
constexpr int kThirdVisible = 57;
constexpr double kSigmaPx = 5;
constexpr double kSigmaMm = 30;
constexpr MotionKind kMotions[] = {MotionKind::kWalk, MotionKind::kReach};

// Mean over motions and seeds of the error in the third frame after the gap, or of the same frame
// of the same seeds without the gap.
double ThirdVisibleFrame(DetectionNoise noise, bool gap, uint64_t num_seeds) {
  double error = 0;
  if (gap) noise.gaps = {kGap};
  for (const MotionKind motion : kMotions) {
    for (uint64_t seed = 1; seed <= num_seeds; ++seed) {
      const SyntheticClip clip = MakeClip(motion, kClipFrames, kClipFps, noise, seed);
      const PoseTrack track = testing::Estimate(clip, testing::PlainOptions());
      error += FrameErrors(clip, clip.skeleton, track.poses)[kThirdVisible];
    }
  }
  return error / static_cast<double>(std::size(kMotions) * num_seeds);
}

// What one frame's detections say about its pose in chart coordinates, with their true errors as
// weights: 2D in pixels, 3D up to an offset.
MatrixXd FrameInformation(const SyntheticClip& clip, const PosePoint& at, const MatrixXd& chart) {
  const int num_dofs = clip.skeleton.num_dofs();
  MatrixXd jacobian = at.joint_jacobian.topRows(3 * kNumPaperJoints);
  jacobian.middleCols<3>(3) *= chart;
  MatrixXd information = MatrixXd::Zero(num_dofs, num_dofs);
  MatrixXd mean = MatrixXd::Zero(3, num_dofs);
  for (int j = 0; j < kNumPaperJoints; ++j) mean += jacobian.middleRows<3>(3 * j) / kNumPaperJoints;
  for (int j = 0; j < kNumPaperJoints; ++j) {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> projection;
    if (!Project(clip.camera, at.state.joints.col(j), &pixel, &projection)) continue;
    const MatrixXd rows2d = projection * jacobian.middleRows<3>(3 * j) / kSigmaPx;
    const MatrixXd rows3d = 1000 * (jacobian.middleRows<3>(3 * j) - mean) / kSigmaMm;
    information += rows2d.transpose() * rows2d + rows3d.transpose() * rows3d;
  }
  return information;
}

// The error in that frame of a smoother that nothing can beat on average which sees every dof on its
// own: linear around the truth, with the true size of all errors, and as prior the true spectrum of
// each dof, which no estimator knows.
double IdealThirdVisibleFrame(MotionKind motion, bool gap) {
  const SyntheticClip clip = MakeClip(motion, kClipFrames, kClipFps, {}, 1);
  const int num_dofs = clip.skeleton.num_dofs();
  std::vector<Eigen::Matrix3d> rotations;
  for (int f = 0; f < kClipFrames; ++f) {
    rotations.push_back(ExpSO3(clip.poses.col(f).segment<3>(3)));
  }
  const RootChart chart(rotations);
  MatrixXd s = clip.poses;
  s.middleRows<3>(3) = chart.Coordinates(rotations);

  // Unknowns frame by frame. The prior's precision of dof n is D^T diag(1 / c_nk^2) D.
  MatrixXd precision = MatrixXd::Zero(num_dofs * kClipFrames, num_dofs * kClipFrames);
  const MatrixXd basis = DctBasis(kClipFrames, kClipFrames);
  const MatrixXd spectrum = s * basis.transpose();
  for (int n = 0; n < num_dofs; ++n) {
    Eigen::VectorXd inverse = Eigen::VectorXd::Constant(kClipFrames, 1e-6);
    for (int k = 1; k < kClipFrames; ++k) {
      const int first = std::max(1, k - 2);
      const int count = std::min(kClipFrames - 1, k + 2) - first + 1;
      const double variance = spectrum.row(n).segment(first, count).squaredNorm() / count;
      inverse[k] = 1 / (variance + 1e-10);
    }
    const MatrixXd of_dof = basis.transpose() * inverse.asDiagonal() * basis;
    for (int f = 0; f < kClipFrames; ++f) {
      for (int g = 0; g < kClipFrames; ++g)
        precision(f * num_dofs + n, g * num_dofs + n) = of_dof(f, g);
    }
  }
  MatrixXd jacobian;  // of the joints in the frame asked for, relative to the hips
  for (int f = 0; f < kClipFrames; ++f) {
    PosePoint at;
    at.pose = clip.poses.col(f);
    at.root_rotation = rotations[f];
    at.Update(clip.skeleton, /*with_jacobian=*/true);
    const Eigen::Matrix3d turn = chart.Jacobian(s.block<3, 1>(3, f));
    if (f == kThirdVisible) {
      jacobian = at.joint_jacobian.topRows(3 * kNumPaperJoints);
      const MatrixXd root =
          0.5 * (jacobian.middleRows<3>(3 * static_cast<int>(JointId::kLeftHip)) +
                 jacobian.middleRows<3>(3 * static_cast<int>(JointId::kRightHip)));
      jacobian -= root.replicate(kNumPaperJoints, 1);
      jacobian.middleCols<3>(3) *= turn;
    }
    if (gap && f >= kGap.begin && f < kGap.end) continue;
    precision.block(f * num_dofs, f * num_dofs, num_dofs, num_dofs) +=
        FrameInformation(clip, at, turn);
  }
  MatrixXd unit = MatrixXd::Zero(num_dofs * kClipFrames, num_dofs);
  unit.middleRows(kThirdVisible * num_dofs, num_dofs).setIdentity();
  const MatrixXd covariance =
      precision.llt().solve(unit).middleRows(kThirdVisible * num_dofs, num_dofs);
  // Mean length of the joints' errors over draws of that covariance.
  const MatrixXd root_of_covariance = covariance.llt().matrixL();
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  constexpr int kDraws = 2000;
  double error = 0;
  for (int i = 0; i < kDraws; ++i) {
    Eigen::VectorXd draw(num_dofs);
    for (double& x : draw) x = normal(rng);
    const MatrixXd errors = (jacobian * (root_of_covariance * draw)).reshaped(3, kNumPaperJoints);
    error += 1000 * errors.colwise().norm().mean() / kDraws;
  }
  return error;
}

double IdealThirdVisibleFrame(bool gap) {
  double error = 0;
  for (const MotionKind motion : kMotions) error += IdealThirdVisibleFrame(motion, gap) / 2;
  return error;
}

TEST(OcclusionTest, WithExactDetectionsErrorsAreBackByTheThirdVisibleFrame) {
  const double whole = ThirdVisibleFrame({}, false, 1);
  const double gap = ThirdVisibleFrame({}, true, 1);
  std::printf("exact: %.1f mm, without the gap %.1f mm\n", gap, whole);
  EXPECT_LE(gap, 1.1 * whole);
}

// White errors average out over the frames around, of which half are missing there: that loses even
// the ideal smoother more than 10 %.
TEST(OcclusionTest, WithNoiseErrorsAreBackAsSoonAsTheyCanBe) {
  constexpr uint64_t kSeeds = 10;
  const DetectionNoise noise = DetectionNoise::White(kSigmaPx, kSigmaMm, 0, 0);
  const double whole = ThirdVisibleFrame(noise, false, kSeeds);
  const double gap = ThirdVisibleFrame(noise, true, kSeeds);
  const double ideal_whole = IdealThirdVisibleFrame(false);
  const double ideal_gap = IdealThirdVisibleFrame(true);
  std::printf("noise: %.1f mm, without the gap %.1f mm; ideal %.1f and %.1f mm\n", gap, whole,
              ideal_gap, ideal_whole);
  EXPECT_GT(ideal_gap, 1.1 * ideal_whole);
  EXPECT_LE(gap / whole, 1.1 * ideal_gap / ideal_whole);
}

}  // namespace
}  // namespace mpc
