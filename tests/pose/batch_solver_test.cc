// The batch problem: E_d and its two forms, the product solver beside the Ceres oracle.
#include "mpc/pose/batch_solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "mpc/pose/batch_oracle.h"
#include "mpc/pose/root_chart.h"
#include "mpc/skeleton/proportions.h"
#include "pose/synthetic_batch.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::MakeBatch;
using testing::MotionInCamera;
using testing::SyntheticBatch;
using testing::Terms;

// A batch without any data: its cost is E_d alone.
BatchProblem EmptyBatch(int num_frames, int basis_size) {
  BatchProblem problem;
  problem.skeleton = DefaultSkeleton();
  problem.frames.resize(num_frames);
  problem.basis = DctBasis(basis_size, num_frames);
  problem.smoothness = VectorXd::LinSpaced(problem.skeleton.num_dofs(), 0.5, 40);
  problem.band_penalty.setZero(problem.smoothness.size(), basis_size);
  return problem;
}

// Shares of the weight for every dof and coefficient; the mean is free.
MatrixXd RandomShares(int basis_size) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> share(0, 0.999);
  MatrixXd shares(DefaultSkeleton().num_dofs(), basis_size);
  for (double& x : shares.reshaped()) x = share(rng);
  shares.col(0).setZero();
  return shares;
}

MatrixXd RandomPoses(int num_frames, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, 0.3);
  MatrixXd poses(DefaultSkeleton().num_dofs(), num_frames);
  for (double& x : poses.reshaped()) x = normal(rng);
  return poses;
}

// S of the header: poses with the root in chart coordinates.
MatrixXd InChart(const MatrixXd& poses) {
  std::vector<Eigen::Matrix3d> rotations;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    rotations.push_back(ExpSO3(poses.col(f).segment<3>(3)));
  }
  MatrixXd s = poses;
  s.middleRows<3>(3) = RootChart(rotations).Coordinates(rotations);
  return s;
}

TEST(BatchCostTest, IsTheNullSpaceFormOfThePaper) {
  for (const int num_frames : {2, 7, 50}) {
    const int basis_size = std::min(8, num_frames);
    const BatchProblem problem = EmptyBatch(num_frames, basis_size);
    const MatrixXd poses = RandomPoses(num_frames, 3);
    const MatrixXd outside = InChart(poses) * BasisComplement(problem.basis).transpose();
    const double expected = (problem.smoothness.cwiseSqrt().asDiagonal() * outside).squaredNorm();
    EXPECT_NEAR(BatchCost(problem, poses), expected, 1e-12 * (1 + expected)) << num_frames;
  }
}

TEST(BatchCostTest, IsTheMinimumOverCoefficients) {
  const BatchProblem problem = EmptyBatch(50, 8);
  const MatrixXd poses = RandomPoses(50, 4);
  const MatrixXd s = InChart(poses);
  const auto cost = [&](const MatrixXd& c) {
    const MatrixXd rest = problem.smoothness.cwiseSqrt().asDiagonal() * (s - c * problem.basis);
    return rest.squaredNorm();
  };
  const MatrixXd best = s * problem.basis.transpose();
  EXPECT_NEAR(BatchCost(problem, poses), cost(best), 1e-12 * cost(best));
  for (unsigned seed = 0; seed < 5; ++seed) {
    EXPECT_GT(cost(best + 0.01 * RandomPoses(8, seed)), cost(best));
  }
}

TEST(BatchCostTest, BandPenaltyIsTheMinimumOverShrunkCoefficients) {
  BatchProblem problem = EmptyBatch(30, 6);
  problem.band_penalty = RandomShares(6);
  const MatrixXd poses = RandomPoses(30, 5);
  const MatrixXd s = InChart(poses);
  const MatrixXd kept = 1 - problem.band_penalty.array();
  const MatrixXd band = problem.band_penalty.array() / kept.array();
  const MatrixXd c = (s * problem.basis.transpose()).cwiseProduct(kept);
  const MatrixXd weight = problem.smoothness.cwiseSqrt().asDiagonal();
  const double expected = (weight * (s - c * problem.basis)).squaredNorm() +
                          (weight * c.cwiseProduct(band.cwiseSqrt())).squaredNorm();
  EXPECT_NEAR(BatchCost(problem, poses), expected, 1e-12 * expected);
}

TEST(BatchCostTest, ConstantPosesCostNothing) {
  const BatchProblem problem = EmptyBatch(50, 8);
  const MatrixXd poses = RandomPoses(1, 6).replicate(1, 50);
  EXPECT_LT(BatchCost(problem, poses), 1e-10);
}

// Where all residuals are zero the reduced Hessian is the curvature of the least cost over all poses.
TEST(ReduceBatchTest, IsTheCurvatureOfTheLeastCost) {
  constexpr int kFrames = 6;
  constexpr double kStep = 1e-5;
  const Skeleton skeleton = DefaultSkeleton();
  const VectorXd pose = testing::MotionInCamera(skeleton, MotionKind::kReach, kFrames, 30).col(3);
  BatchProblem problem = EmptyBatch(kFrames, 3);
  problem.frames.clear();
  std::mt19937 rng(1);
  testing::FrameIngredients frame = testing::MakeIngredients(
      skeleton, testing::SyntheticCamera(), pose, testing::Terms::kOurs, 0, 0, &rng);
  frame.rest = pose.tail(skeleton.num_dofs() - 6);
  for (int f = 0; f < kFrames; ++f) {
    problem.frames.push_back(frame.Problem(testing::SyntheticCamera()));
  }
  const MatrixXd poses = pose.replicate(1, kFrames);
  const auto stepped = [&](BodyPart part, double log_scale) {
    Proportions proportions;
    proportions.part[static_cast<size_t>(part)] = std::exp(log_scale);
    return ScaledSkeleton(skeleton, proportions);
  };
  const auto parts = {BodyPart::kThigh, BodyPart::kUpperArm};
  std::vector<SteppedProblem> moved;
  for (const BodyPart part : parts) moved.push_back({stepped(part, kStep), problem.frames});
  const ReducedSystem reduced = ReduceBatch(problem, poses, moved, kStep);
  EXPECT_LT(reduced.gradient.norm(), 1e-3 * reduced.hessian.norm());
  EXPECT_LT((reduced.hessian - reduced.hessian.transpose()).norm(), 1e-9);
  int p = 0;
  for (const BodyPart part : parts) {
    constexpr double kChange = 0.01;
    BatchProblem scaled = problem;
    scaled.skeleton = stepped(part, kChange);
    MatrixXd solved = poses;
    const double fixed_cost = BatchCost(scaled, poses);
    const double cost =
        SolveBatch(scaled, {.max_iterations = 100, .relative_tolerance = 1e-9}, &solved).final_cost;
    EXPECT_NEAR(cost, kChange * kChange * reduced.hessian(p, p), 0.05 * cost);
    EXPECT_LT(cost, 0.9 * fixed_cost);
    ++p;
  }
}

TEST(ReduceBatchTest, OutsideTheDomainSaysNothing) {
  SyntheticBatch batch =
      testing::MakeBatch(testing::MotionInCamera(DefaultSkeleton(), MotionKind::kWalk, 4, 30), 30,
                         testing::Terms::kOurs, 1);
  batch.truth.row(2).setConstant(-1);  // behind the camera
  const ReducedSystem reduced = ReduceBatch(
      batch.problem, batch.truth, {{batch.problem.skeleton, batch.problem.frames}}, /*step=*/1e-4);
  EXPECT_TRUE(reduced.hessian.isZero());
  EXPECT_TRUE(reduced.gradient.isZero());
}

TEST(BatchCostTest, OutsideTheDomainIsInfinite) {
  SyntheticBatch batch =
      MakeBatch(MotionInCamera(DefaultSkeleton(), MotionKind::kWalk, 10, 30), 30, Terms::kOurs, 1);
  ASSERT_TRUE(std::isfinite(BatchCost(batch.problem, batch.truth)));
  batch.truth(2, 4) = -2;  // behind the camera
  EXPECT_TRUE(std::isinf(BatchCost(batch.problem, batch.truth)));
  const MatrixXd before = batch.truth;
  EXPECT_EQ(SolveBatch(batch.problem, {}, &batch.truth).termination, Termination::kFailed);
  EXPECT_LT((batch.truth - before).topRows<3>().norm(), 1e-12);
  EXPECT_EQ(SolveBatchCeres(batch.problem, {}, &batch.truth).termination, Termination::kFailed);
}

// Without damping one step solves a quadratic problem: hinges at rest angles of their own per
// frame, tied by E_d with a soft band.
TEST(BatchStepTest, SolvesAQuadraticProblemAtOnce) {
  BatchProblem problem = EmptyBatch(20, 6);
  problem.band_penalty = RandomShares(6);
  std::mt19937 rng(6);
  std::uniform_real_distribution<double> share(0.4, 0.6);
  MatrixXd poses = MatrixXd::Zero(problem.skeleton.num_dofs(), 20);
  const int num_hinges = static_cast<int>(problem.skeleton.hinges.size());
  for (int f = 0; f < 20; ++f) {
    VectorXd rest(num_hinges);
    for (int h = 0; h < num_hinges; ++h) {
      const Hinge& hinge = problem.skeleton.hinges[h];
      rest[h] = hinge.min_rad + share(rng) * (hinge.max_rad - hinge.min_rad);
    }
    problem.frames[f].rest_prior = RestPriorEnergy(rest, VectorXd::Constant(num_hinges, 3));
    poses.col(f).tail(num_hinges) = rest;
  }
  MatrixXd one = poses;
  MatrixXd many = poses;
  const double after_one =
      SolveBatch(problem, {.max_iterations = 1, .initial_damping = 1e-12}, &one).final_cost;
  const SolveSummary best =
      SolveBatch(problem, {.max_iterations = 50, .relative_tolerance = 1e-14}, &many);
  EXPECT_LT(best.final_cost, 0.9 * best.initial_cost);
  EXPECT_NEAR(after_one, best.final_cost, 1e-7 * best.final_cost);
}

struct TwinCase {
  const char* name;
  MotionKind motion;
  Terms terms;
  int num_frames;
  double bend;  // added to all angles of the truth: beyond the bounds where they are near

  friend std::ostream& operator<<(std::ostream& os, const TwinCase& c) { return os << c.name; }
};

class BatchSolverTest : public ::testing::TestWithParam<TwinCase> {
 protected:
  SyntheticBatch Batch() const {
    MatrixXd poses =
        MotionInCamera(DefaultSkeleton(), GetParam().motion, GetParam().num_frames, 15);
    poses.bottomRows(poses.rows() - 6).array() += GetParam().bend;
    // Everywhere with a rest prior: dofs that nothing observes need not end alike.
    return MakeBatch(poses, 15, GetParam().terms, 7, /*rest_weight=*/30);
  }
};

TEST_P(BatchSolverTest, ReachesTheCostOfTheOracle) {
  const SyntheticBatch batch = Batch();
  MatrixXd product = batch.start;
  MatrixXd oracle = batch.start;
  const SolveSummary fast =
      SolveBatch(batch.problem, {.max_iterations = 200, .relative_tolerance = 1e-7}, &product);
  const SolveSummary ceres = SolveBatchCeres(batch.problem, {}, &oracle);
  EXPECT_NEAR(fast.initial_cost, ceres.initial_cost, 1e-9 * ceres.initial_cost);
  EXPECT_LT(fast.final_cost, 0.5 * fast.initial_cost);
  // Ours may not be worse; with bounds the two can end in different minima.
  EXPECT_LE(fast.final_cost, 1.001 * ceres.final_cost);
  if (GetParam().bend == 0) return;
  int active = 0;
  for (int f = 0; f < product.cols(); ++f) {
    active += static_cast<int>(
        (product.col(f).array() <= batch.problem.skeleton.LowerBounds().array()).count());
  }
  EXPECT_GT(active, 10);
}

TEST_P(BatchSolverTest, NeverGetsWorseAndStaysInBounds) {
  const SyntheticBatch batch = Batch();
  MatrixXd poses = batch.start;
  double before = std::numeric_limits<double>::infinity();
  for (const int iterations : {1, 2, 5, 30}) {
    poses = batch.start;
    const SolveSummary summary = SolveBatch(batch.problem, {.max_iterations = iterations}, &poses);
    EXPECT_LE(summary.final_cost, summary.initial_cost);
    EXPECT_LE(summary.final_cost, before);
    before = summary.final_cost;
    for (int f = 0; f < poses.cols(); ++f) {
      EXPECT_TRUE((poses.col(f).array() >= batch.problem.skeleton.LowerBounds().array()).all());
      EXPECT_TRUE((poses.col(f).array() <= batch.problem.skeleton.UpperBounds().array()).all());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Motions, BatchSolverTest,
    ::testing::Values(TwinCase{"walk_paper", MotionKind::kWalk, Terms::kPaper, 16, 0},
                      TwinCase{"walk_ours", MotionKind::kWalk, Terms::kOurs, 16, 0},
                      TwinCase{"two_turns_paper", MotionKind::kTurn, Terms::kPaper, 16, 0},
                      TwinCase{"two_turns_ours", MotionKind::kTurn, Terms::kOurs, 16, 0},
                      TwinCase{"bounds_paper", MotionKind::kReach, Terms::kPaper, 8, -0.4},
                      TwinCase{"bounds_ours", MotionKind::kReach, Terms::kOurs, 8, -0.4},
                      TwinCase{"roll_ours", MotionKind::kRoll, Terms::kOurs, 16, 0}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace mpc
