// The solver of one set of correspondences against Ceres.
#include "mpc/deform/refinement_solver.h"

#include <gtest/gtest.h>

#include "deform/posed_actor.h"
#include "mpc/deform/pose_refinement.h"

namespace mpc {
namespace {

using Eigen::VectorXd;
using testing::Actor;

class RefinementSolver : public ::testing::Test {
 protected:
  RefinementProblem Problem(const VectorXd& start, double robust_px) {
    CorrespondenceScratch scratch;
    found_ = FindCorrespondences(camera_, testing::Vertices(Actor(), start),
                                 SurfaceTopology::FromMesh(Actor().mesh), BodyParts(Actor()),
                                 IndexSilhouette(silhouette_, camera_),
                                 PoseRefinementOptions().correspondences, &scratch);
    return RefinementProblem(Actor(), ContourEnergy(camera_, found_, robust_px),
                             StabilityEnergy(Actor().skeleton, start, 0.06, 0.95));
  }

  Camera camera_ = testing::Camera1080();
  VectorXd truth_ = testing::MidWalk();
  Contour2d silhouette_ = testing::SilhouetteOf(camera_, Actor(), truth_);
  Correspondences found_;
};

// With the product's own options, from starts some of which are at bounds.
TEST_F(RefinementSolver, ComesWithinHalfAPercentOfCeres) {
  const PoseRefinementOptions product;
  const VectorXd lower = Actor().skeleton.LowerBounds();
  for (unsigned seed = 0; seed < 6; ++seed) {
    VectorXd start = testing::Perturbed(truth_, seed);
    if (seed % 2 == 1) {
      for (int n = 6; n < start.size(); n += 4) start[n] = lower[n];
    }
    const RefinementProblem problem = Problem(start, seed % 3 == 0 ? 0 : 20);
    VectorXd ours = start, oracle = start;
    const RefinementSolve solve =
        SolveRefinement(problem, product.relative_tolerance, product.max_steps, &ours);
    const RefinementSolve reference = SolveRefinementCeres(problem, 1e-8, 200, &oracle);
    EXPECT_FALSE(solve.failed);
    EXPECT_NEAR(solve.initial_cost, reference.initial_cost, 1e-9 * solve.initial_cost);
    EXPECT_LT(solve.final_cost, solve.initial_cost);
    EXPECT_LT(solve.final_cost, 1.005 * reference.final_cost) << "seed " << seed;
    EXPECT_TRUE((ours.array() >= lower.array()).all());
    EXPECT_TRUE((ours.array() <= Actor().skeleton.UpperBounds().array()).all());
  }
}

TEST_F(RefinementSolver, StopsAtTheMinimum) {
  const RefinementProblem problem = Problem(testing::Perturbed(truth_, 4), 0);
  VectorXd pose = testing::Perturbed(truth_, 4);
  SolveRefinement(problem, 1e-12, 200, &pose);
  VectorXd again = pose;
  const RefinementSolve solve = SolveRefinement(problem, 1e-12, 200, &again);
  EXPECT_NEAR(solve.final_cost, solve.initial_cost, 1e-6 * solve.initial_cost);
  EXPECT_LT((again - pose).norm(), 1e-3);
}

TEST_F(RefinementSolver, AStartBehindTheCameraFails) {
  const RefinementProblem problem = Problem(truth_, 0);
  VectorXd behind = truth_;
  behind[2] = -3;
  VectorXd pose = behind;
  EXPECT_TRUE(SolveRefinement(problem, 1e-3, 10, &pose).failed);
  EXPECT_EQ(pose, behind);
  EXPECT_TRUE(SolveRefinementCeres(problem, 1e-3, 10, &pose).failed);
  EXPECT_EQ(pose, behind);
}

}  // namespace
}  // namespace mpc
