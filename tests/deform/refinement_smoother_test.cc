#include "mpc/deform/refinement_smoother.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "mpc/eval/motions.h"
#include "mpc/skeleton/skinning.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

constexpr double kFps = 24;

class RefinementSmootherTest : public ::testing::Test {
 protected:
  RefinementSmootherTest() {
    const RigAsset rig = testing::MakeTestRig();
    character_ = BuildCharacter(rig, MapRigByNames(rig));
    batch_ = MakeMotion(character_.skeleton, MotionKind::kWalk, 0.5, kFps);
    refined_ = batch_;
    for (Eigen::Index f = 0; f < batch_.cols(); ++f) {
      refined_.col(f).head<3>() += 0.01 * Eigen::Vector3d::Random();
      is_refined_.push_back(f != 4);
    }
  }

  FrameRefinement Frame(Eigen::Index f) const {
    FrameRefinement frame;
    frame.pose = is_refined_[static_cast<size_t>(f)] ? refined_.col(f) : batch_.col(f);
    frame.pose_state =
        is_refined_[static_cast<size_t>(f)] ? RefinementState::kRefined : RefinementState::kNoMatch;
    return frame;
  }

  Character character_;
  Eigen::MatrixXd batch_;
  Eigen::MatrixXd refined_;
  std::vector<bool> is_refined_;
};

// Frame by frame it gives what smoothing the whole clip gives, and no frame comes too early.
TEST_F(RefinementSmootherTest, StreamsWhatTheWholeClipGives) {
  SmoothingOptions options;
  options.depth_seconds = 0;
  const Eigen::MatrixXd expected =
      SmoothPoses(character_.skeleton, batch_, refined_, is_refined_, options);
  RefinementSmoother smoother(character_, kFps, options);
  SmoothedFrame frame;
  Eigen::Index next = 0;
  for (Eigen::Index f = 0; f < batch_.cols(); ++f) {
    smoother.Push(batch_.col(f), Frame(f));
    while (smoother.Pop(&frame)) {
      EXPECT_TRUE(frame.pose.isApprox(expected.col(next), 1e-12)) << next;
      ++next;
    }
    EXPECT_EQ(next, std::max<Eigen::Index>(0, f - 3)) << f;
  }
  smoother.End();
  while (smoother.Pop(&frame)) {
    EXPECT_TRUE(frame.pose.isApprox(expected.col(next), 1e-12)) << next;
    ++next;
  }
  EXPECT_EQ(next, batch_.cols());
}

// A displacement that is constant on the body comes back on the smoothed pose.
TEST_F(RefinementSmootherTest, DisplacementsMoveWithTheBody) {
  SmoothingOptions options;
  options.depth_seconds = 0;
  RefinementSmoother smoother(character_, kFps, options);
  const Eigen::Index num_vertices = character_.mesh.positions.cols();
  Eigen::Matrix3Xf at_bind(3, num_vertices);
  at_bind.colwise() = Eigen::Vector3f(0.01f, -0.02f, 0.03f);
  for (Eigen::Index f = 0; f < batch_.cols(); ++f) {
    FrameRefinement frame = Frame(f);
    frame.displacements = at_bind;
    smoother.Push(batch_.col(f), std::move(frame));
  }
  smoother.End();
  SmoothedFrame frame;
  int count = 0;
  while (smoother.Pop(&frame)) {
    KinematicState state;
    ForwardKinematics(character_.skeleton, frame.pose, &state);
    Eigen::Matrix3Xf expected;
    SkinCharacter(character_, state, &expected);
    Eigen::Matrix3Xf displacements = at_bind;
    TurnFromBind(character_, state, &displacements);
    expected += displacements;
    EXPECT_LT((frame.vertices - expected).cwiseAbs().maxCoeff(), 1e-5f);
    ++count;
  }
  EXPECT_EQ(count, batch_.cols());
}

// A step that no parabola follows, as the outline shows it: kept where it does, sideways only.
TEST_F(RefinementSmootherTest, AStepThatTheOutlineShowsIsKept) {
  batch_ = TransformPoses(Eigen::Matrix3d::Identity(), {0, -1, 4}, batch_.col(0).replicate(1, 24));
  const Eigen::Index num_vertices = character_.mesh.positions.cols();
  constexpr Eigen::Index kStep = 12;
  const auto worst = [&](double keep_m, float evidence, const Eigen::Vector3d& step) {
    SmoothingOptions options;
    options.depth_seconds = 0;
    options.keep_m = keep_m;
    RefinementSmoother smoother(character_, kFps, options);
    std::vector<Eigen::Matrix3Xf> surfaces;
    for (Eigen::Index f = 0; f < batch_.cols(); ++f) {
      FrameRefinement refinement;
      refinement.pose_state = RefinementState::kRefined;
      refinement.pose = batch_.col(f);
      if (f >= kStep) refinement.pose.head<3>() += step;
      refinement.displacements.setZero(3, num_vertices);
      KinematicState state;
      ForwardKinematics(character_.skeleton, refinement.pose, &state);
      SkinCharacter(character_, state, &refinement.surface);
      refinement.evidence.setConstant(num_vertices, evidence);
      surfaces.push_back(refinement.surface);
      smoother.Push(batch_.col(f), std::move(refinement));
    }
    smoother.End();
    SmoothedFrame frame;
    double most = 0;
    for (size_t f = 0; smoother.Pop(&frame); ++f) {
      most = std::max<double>(most, (frame.vertices - surfaces[f]).colwise().norm().maxCoeff());
    }
    return most;
  };
  const Eigen::Vector3d aside(0.2, 0, 0), away(0, 0, 0.2);
  const double keep_m = SmoothingOptions().keep_m;
  EXPECT_GT(worst(0, 100, aside), 0.02);
  EXPECT_LT(worst(keep_m, 100, aside), 0.6 * worst(0, 100, aside));
  EXPECT_NEAR(worst(keep_m, 0, aside), worst(0, 0, aside), 1e-6);
  // What the window makes of a depth stays, up to what that moves in the picture.
  EXPECT_GT(worst(keep_m, 100, away), 0.8 * worst(0, 100, away));
}

// An actor that silhouettes put nearer and farther from frame to frame is put in between, and looks
// as it did from the camera.
TEST_F(RefinementSmootherTest, DepthIsSmoothedAlongTheRay) {
  batch_ = TransformPoses(Eigen::Matrix3d::Identity(), {0, -1, 4}, batch_.col(0).replicate(1, 24));
  refined_ = batch_;
  const SmoothingOptions options;
  RefinementSmoother smoother(character_, kFps, options);
  const int reach = static_cast<int>(std::lround(kFps * options.depth_seconds)) + 4;
  const auto depth_of = [](const Eigen::VectorXd& pose) { return pose.head<3>().norm(); };
  const auto posed = [&](const Eigen::VectorXd& pose) {
    KinematicState state;
    ForwardKinematics(character_.skeleton, pose, &state);
    Eigen::Matrix3Xf vertices;
    SkinCharacter(character_, state, &vertices);
    return vertices;
  };
  SmoothedFrame frame;
  Eigen::Index count = 0;
  double rough = 0, smooth = 0, smooth_ends = 0, off_picture = 0, off_centre = 0;
  const auto pop = [&] {
    while (smoother.Pop(&frame)) {
      const double mean = depth_of(batch_.col(0)) - 0.1;
      rough = std::max(rough, std::abs(depth_of(refined_.col(count)) - mean));
      // At an end of the clip there are neighbours on one side only.
      const bool inside = count >= 5 && count < batch_.cols() - 5;
      (inside ? smooth : smooth_ends) =
          std::max(inside ? smooth : smooth_ends, std::abs(depth_of(frame.pose) - mean));
      const Eigen::Matrix3Xf expected = posed(batch_.col(0));
      off_picture = std::max<double>(
          off_picture, (frame.vertices.colwise().hnormalized() - expected.colwise().hnormalized())
                           .colwise()
                           .norm()
                           .maxCoeff());
      off_centre = std::max<double>(
          off_centre,
          (frame.pose.head<3>().normalized() - batch_.col(0).head<3>().normalized()).norm());
      ++count;
    }
  };
  for (Eigen::Index f = 0; f < batch_.cols(); ++f) {
    const double scale = 1 - (f % 2 == 0 ? 0.13 : 0.07) / depth_of(batch_.col(0));
    FrameRefinement refinement;
    refinement.pose_state = RefinementState::kRefined;
    refined_.col(f).head<3>() *= scale;
    refinement.pose = refined_.col(f);
    // The surface fills the outline at whatever depth the skeleton is.
    refinement.displacements =
        static_cast<float>(scale) * posed(batch_.col(f)) - posed(refined_.col(f));
    KinematicState state;
    ForwardKinematics(character_.skeleton, refinement.pose, &state);
    TurnToBind(character_, state, &refinement.displacements);
    smoother.Push(batch_.col(f), std::move(refinement));
    pop();
    EXPECT_EQ(count, std::max<Eigen::Index>(0, f + 1 - reach)) << f;
  }
  smoother.End();
  pop();
  EXPECT_EQ(count, batch_.cols());
  EXPECT_NEAR(rough, 0.03, 1e-3);
  EXPECT_LT(smooth, 0.003);
  EXPECT_LT(smooth_ends, 0.015);
  EXPECT_LT(off_picture, 2e-4);
  EXPECT_LT(off_centre, 2e-3);
}

TEST_F(RefinementSmootherTest, AnEmptyClipGivesNothing) {
  RefinementSmoother smoother(character_, kFps, {});
  SmoothedFrame frame;
  EXPECT_FALSE(smoother.Pop(&frame));
  smoother.End();
  EXPECT_FALSE(smoother.Pop(&frame));
}

}  // namespace
}  // namespace mpc
