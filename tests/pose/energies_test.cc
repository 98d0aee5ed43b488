// Every per-frame energy: Jacobians, weights, zero residuals, refusals.
#include <gtest/gtest.h>

#include <random>

#include "mpc/pose/frame_problem.h"
#include "pose/autodiff_twin.h"
#include "pose/synthetic_batch.h"
#include "support/check_jacobian.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::FrameIngredients;
using testing::Terms;

constexpr int kPoints = 20;

class EnergiesTest : public ::testing::Test {
 protected:
  EnergiesTest() { camera_.distortion = {0.1, -0.05, 1e-3, -5e-4, 0.01}; }

  // In front of the camera, any facing.
  VectorXd RandomPose() {
    std::normal_distribution<double> normal;
    VectorXd pose(skeleton_.num_dofs());
    for (double& x : pose) x = 0.4 * normal(rng_);
    pose.head<3>() += Eigen::Vector3d(0, 0, 5);
    pose.segment<3>(3) += Eigen::Vector3d(2, 0, 0);
    return pose;
  }

  PosePoint PointAt(const VectorXd& pose) const {
    PosePoint point;
    point.pose = pose;
    point.root_rotation = ExpSO3(pose.segment<3>(3));
    point.Update(skeleton_, /*with_jacobian=*/true);
    return point;
  }

  // Some joints standing, each a little off its place.
  StandingEnergy Standing(const VectorXd& pose, double noise_m) {
    std::normal_distribution<double> normal;
    const PosePoint at = PointAt(pose);
    std::vector<StandingJoint> joints;
    for (const int j : {1, 4, 9}) {
      const Eigen::Vector3d x = at.state.joints.col(j);
      joints.push_back({j, x.normalized(), x.norm() + noise_m * normal(rng_), 0.3 + j});
      joints.push_back(joints.back());
      joints.back().one_sided = true;
    }
    return {joints, 90};
  }

  template <typename Energy>
  VectorXd Residuals(const Energy& energy, const VectorXd& pose,
                     MatrixXd* jacobian = nullptr) const {
    VectorXd r(energy.num_residuals());
    if (jacobian != nullptr) jacobian->setZero(r.size(), pose.size());
    EXPECT_TRUE(energy.Evaluate(PointAt(pose), 0, &r, jacobian));
    return r;
  }

  template <typename Energy>
  void CheckDerivative(const Energy& energy, const VectorXd& pose, double tolerance) const {
    MatrixXd jacobian;
    const VectorXd with_jacobian = Residuals(energy, pose, &jacobian);
    EXPECT_EQ(with_jacobian, Residuals(energy, pose));
    const auto plus = [](const VectorXd& x, const VectorXd& d) -> VectorXd {
      VectorXd moved = x + d;
      moved.segment<3>(3) = LogSO3(ExpSO3(d.segment<3>(3)) * ExpSO3(x.segment<3>(3)));
      return moved;
    };
    testing::CheckJacobian([&](const VectorXd& x) { return Residuals(energy, x); }, plus, pose,
                           jacobian, tolerance);
  }

  FrameIngredients Ingredients(const VectorXd& pose, Terms terms, double noise) {
    return testing::MakeIngredients(skeleton_, camera_, pose, terms, 5 * noise, 40 * noise, &rng_);
  }

  Skeleton skeleton_ = DefaultSkeleton();
  Camera camera_ = testing::SyntheticCamera();
  std::mt19937 rng_{11};
};

TEST_F(EnergiesTest, JacobiansAreTheDerivatives) {
  for (int i = 0; i < kPoints; ++i) {
    const VectorXd pose = RandomPose();
    for (const Terms terms : {Terms::kPaper, Terms::kOurs}) {
      const FrameProblem problem = Ingredients(pose, terms, 5).Problem(camera_);
      CheckDerivative(problem.reprojection, pose, 1e-6);
      CheckDerivative(problem.joint_positions, pose, 1e-6);
      CheckDerivative(problem.bone_vectors, pose, 1e-6);
      CheckDerivative(problem.rest_prior, pose, 1e-6);
    }
    CheckDerivative(Standing(pose, 0.1), pose, 1e-6);
  }
}

TEST_F(EnergiesTest, PerfectDetectionsCostNothingAndAreSmoothThere) {
  const VectorXd pose = RandomPose();
  for (const Terms terms : {Terms::kPaper, Terms::kOurs}) {
    FrameIngredients frame = Ingredients(pose, terms, 0);
    if (frame.rest.size() > 0) frame.rest = pose.tail(frame.rest.size());
    const FrameProblem problem = frame.Problem(camera_);
    FrameScratch scratch;
    EXPECT_LT(EvaluateFrame(problem, PointAt(pose), &scratch), 1e-18);
    CheckDerivative(problem.reprojection, pose, 1e-6);
    CheckDerivative(problem.joint_positions, pose, 1e-6);
    CheckDerivative(problem.bone_vectors, pose, 1e-6);
    CheckDerivative(problem.rest_prior, pose, 1e-6);
  }
}

TEST_F(EnergiesTest, JacobiansEqualAutomaticDifferentiation) {
  for (int i = 0; i < kPoints; ++i) {
    const VectorXd pose = RandomPose();
    for (const Terms terms : {Terms::kPaper, Terms::kOurs}) {
      const FrameIngredients frame = Ingredients(pose, terms, 1);
      FrameScratch scratch;
      MatrixXd hessian;
      VectorXd gradient;
      EvaluateFrame(frame.Problem(camera_), PointAt(pose), &scratch, &hessian, &gradient);
      const MatrixXd twin = testing::TwinJacobian(skeleton_, camera_, frame, pose);
      ASSERT_EQ(twin.rows(), scratch.jacobian.rows());
      EXPECT_LT((twin - scratch.jacobian).cwiseAbs().maxCoeff(),
                1e-10 * twin.cwiseAbs().maxCoeff());
      EXPECT_LT((hessian - twin.transpose() * twin).norm(), 1e-9 * hessian.norm());
      EXPECT_LT((gradient - twin.transpose() * scratch.residuals).norm(), 1e-9 * gradient.norm());
    }
  }
}

// The normal equations are summed over the dofs that rows depend on, never over whole rows.
TEST_F(EnergiesTest, NormalEquationsAreThoseOfAllRows) {
  for (const Terms terms : {Terms::kPaper, Terms::kOurs}) {
    const VectorXd pose = RandomPose();
    FrameProblem problem = Ingredients(pose, terms, 5).Problem(camera_);
    problem.track_prior = TrackPriorEnergy(RandomPose(), 3000, 200);
    problem.standing = Standing(pose, 0.1);
    CheckDerivative(problem.track_prior, pose, 1e-6);
    FrameScratch scratch;
    MatrixXd hessian;
    VectorXd gradient;
    const double cost = EvaluateFrame(problem, PointAt(pose), &scratch, &hessian, &gradient);
    const MatrixXd& j = scratch.jacobian;
    ASSERT_EQ(j.rows(), problem.num_residuals());
    EXPECT_LT((hessian - j.transpose() * j).norm(), 1e-12 * hessian.norm());
    EXPECT_LT((gradient - j.transpose() * scratch.residuals).norm(), 1e-12 * gradient.norm());
    EXPECT_EQ(cost, EvaluateFrame(problem, PointAt(pose), &scratch));
  }
}

TEST_F(EnergiesTest, TwiceTheWeightIsTwiceTheCost) {
  const VectorXd pose = RandomPose();
  for (const Terms terms : {Terms::kPaper, Terms::kOurs}) {
    const FrameIngredients once = Ingredients(pose, terms, 1);
    FrameIngredients twice = once;
    for (Observation2d& point : twice.points) point.weight *= 2;
    for (BoneObservation& bone : twice.bones) bone.weight *= 2;
    twice.weight_3d *= 2;
    twice.rest_weights *= 2;
    const FrameProblem a = once.Problem(camera_);
    const FrameProblem b = twice.Problem(camera_);
    const auto expect_double = [&](const auto& energy, const auto& doubled) {
      const double cost = Residuals(energy, pose).squaredNorm();
      EXPECT_NEAR(Residuals(doubled, pose).squaredNorm(), 2 * cost, 1e-12 * cost);
    };
    expect_double(a.reprojection, b.reprojection);
    expect_double(a.joint_positions, b.joint_positions);
    expect_double(a.bone_vectors, b.bone_vectors);
    expect_double(a.rest_prior, b.rest_prior);
  }
}

TEST_F(EnergiesTest, ARestPriorWithWidthsForgivesWhoIsFarFromRest) {
  constexpr double kWeight = 3;
  constexpr double kWidth = 0.4;
  const Eigen::Index num_hinges = skeleton_.num_dofs() - 6;
  const VectorXd rest = VectorXd::Constant(num_hinges, 0.1);
  const VectorXd weights = VectorXd::Constant(num_hinges, kWeight);
  const RestPriorEnergy plain(rest, weights);
  const RestPriorEnergy robust(rest, weights, VectorXd::Constant(num_hinges, kWidth));
  for (int i = 0; i < kPoints; ++i) {
    const VectorXd pose = RandomPose();
    CheckDerivative(robust, pose, 1e-6);
    const VectorXd r = Residuals(robust, pose);
    EXPECT_LT(r.squaredNorm(), Residuals(plain, pose).squaredNorm());
    EXPECT_LT(r.array().square().maxCoeff(), kWeight * kWidth * kWidth);
  }
  VectorXd near = VectorXd::Zero(skeleton_.num_dofs());
  near.tail(num_hinges) = rest.array() + 0.01;
  EXPECT_NEAR(Residuals(robust, near).squaredNorm(), Residuals(plain, near).squaredNorm(),
              2e-3 * Residuals(plain, near).squaredNorm());
}

TEST_F(EnergiesTest, ARestPriorOfSomeHingesIsTheirRows) {
  const Eigen::Index num_hinges = skeleton_.num_dofs() - 6;
  const RestPriorEnergy whole(VectorXd::Constant(num_hinges, 0.1),
                              VectorXd::LinSpaced(num_hinges, 1, 2),
                              VectorXd::LinSpaced(num_hinges, 0.2, 0.9));
  const std::vector<int> hinges = {2, 7};
  const VectorXd pose = RandomPose();
  VectorXd part = VectorXd::Zero(6 + 2);
  part[6] = pose[6 + 2];
  part[7] = pose[6 + 7];
  VectorXd r(2);
  PosePoint at;
  at.pose = part;
  ASSERT_TRUE(whole.Restricted(hinges).Evaluate(at, 0, &r, nullptr));
  EXPECT_EQ(r, VectorXd(Residuals(whole, pose)(hinges)));
}

TEST_F(EnergiesTest, AStandingJointIsHeldAlongItsRayOnly) {
  const VectorXd pose = RandomPose();
  const StandingEnergy energy = Standing(pose, 0);
  EXPECT_LT(Residuals(energy, pose).norm(), 1e-9);
  const StandingJoint& first = energy.joints()[0];
  VectorXd moved = pose;
  moved.head<3>() += 0.02 * first.ray.unitOrthogonal();
  EXPECT_LT(std::abs(Residuals(energy, moved)[0]), 1e-9);
  moved = pose;
  moved.head<3>() += 1e-3 * first.ray;
  EXPECT_NEAR(Residuals(energy, moved)[0], std::sqrt(first.weight), 1e-3);
  moved.head<3>() += 1e3 * first.ray;
  EXPECT_NEAR(Residuals(energy, moved)[0], 90 * std::sqrt(first.weight), 1e-3);
}

TEST_F(EnergiesTest, TheFloorIsInTheWayOfWhatIsBelowAlone) {
  const VectorXd pose = RandomPose();
  const Eigen::Vector3d down = Eigen::Vector3d(0.1, 1, 0.2).normalized();
  const double deep_m = down.dot(PointAt(pose).state.joints.col(4));
  const auto residual = [&](double floor_m, bool one_sided, MatrixXd* jacobian) {
    const StandingEnergy energy({{4, down, floor_m, 0.5, one_sided}}, 90);
    return Residuals(energy, pose, jacobian)[0];
  };
  MatrixXd above, below, held;
  EXPECT_EQ(residual(deep_m + 0.01, true, &above), 0);
  EXPECT_TRUE(above.isZero());
  EXPECT_EQ(residual(deep_m - 0.01, true, &below), residual(deep_m - 0.01, false, &held));
  EXPECT_EQ(below, held);
  EXPECT_GT(below.norm(), 1);
}

TEST_F(EnergiesTest, AJointBehindTheCameraIsRefused) {
  VectorXd pose = RandomPose();
  const FrameProblem problem = Ingredients(pose, Terms::kOurs, 1).Problem(camera_);
  pose[2] = 0;
  VectorXd r(problem.reprojection.num_residuals());
  EXPECT_FALSE(problem.reprojection.Evaluate(PointAt(pose), 0, &r, nullptr));
  FrameScratch scratch;
  EXPECT_TRUE(std::isinf(EvaluateFrame(problem, PointAt(pose), &scratch)));
}

TEST_F(EnergiesTest, TranslatingTheDetectionsIn3dChangesNothing) {
  const VectorXd pose = RandomPose();
  FrameIngredients frame = Ingredients(pose, Terms::kPaper, 1);
  const VectorXd before = Residuals(frame.Problem(camera_).joint_positions, pose);
  frame.positions.colwise() += Eigen::Vector3d(3, -1, 7);
  const VectorXd after = Residuals(frame.Problem(camera_).joint_positions, pose);
  EXPECT_LT((before - after).norm(), 1e-9);
}

TEST(RobustLossTest, BoundsTheCostAndLeavesSmallResidualsAlone) {
  for (const double size : {1e-3, 1.0, 1e3}) {
    VectorXd r = VectorXd::Constant(4, size);
    ApplyRobustLoss<2>(2, r.segment<2>(1), nullptr);
    EXPECT_EQ(r[0], size);
    EXPECT_EQ(r[3], size);
    const double squared = 2 * size * size;
    EXPECT_NEAR(r.segment<2>(1).squaredNorm(), squared / (1 + squared / 4), 1e-12);
    EXPECT_LE(r.segment<2>(1).squaredNorm(), 4);
  }
  VectorXd plain = VectorXd::Constant(4, 5);
  ApplyRobustLoss<3>(0, plain.head<3>(), nullptr);
  EXPECT_EQ(plain, VectorXd::Constant(4, 5));
}

}  // namespace
}  // namespace mpc
