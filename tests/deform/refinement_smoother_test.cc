#include "mpc/deform/refinement_smoother.h"

#include <gtest/gtest.h>

#include <vector>

#include "mpc/eval/motions.h"
#include "mpc/skeleton/skinning.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

class RefinementSmootherTest : public ::testing::Test {
 protected:
  RefinementSmootherTest() {
    const RigAsset rig = testing::MakeTestRig();
    character_ = BuildCharacter(rig, MapRigByNames(rig));
    batch_ = MakeMotion(character_.skeleton, MotionKind::kWalk, 0.5, 24);
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
  const SmoothingOptions options;
  const Eigen::MatrixXd expected =
      SmoothPoses(character_.skeleton, batch_, refined_, is_refined_, options);
  RefinementSmoother smoother(character_, options);
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
  RefinementSmoother smoother(character_, {});
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

TEST_F(RefinementSmootherTest, AnEmptyClipGivesNothing) {
  RefinementSmoother smoother(character_, {});
  SmoothedFrame frame;
  EXPECT_FALSE(smoother.Pop(&frame));
  smoother.End();
  EXPECT_FALSE(smoother.Pop(&frame));
}

}  // namespace
}  // namespace mpc
