#include "mpc/deform/surface_solver.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "deform/surface_meshes.h"
#include "mpc/core/rigid.h"
#include "support/check_jacobian.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

// A trunk and a skirt 4 m away whose outline has targets some centimetres aside.
class SurfaceSolverTest : public ::testing::Test {
 protected:
  void Prepare(int num_nodes, int width = 1920, int height = 1080) {
    mesh_ = testing::Dressed();
    camera_ = Camera::FromFov(width, height, 0.9);
    graph_ = BuildDeformationGraph(mesh_, {.num_nodes = num_nodes});
    Eigen::Matrix3Xf normals;
    VertexNormals(mesh_.positions, mesh_.triangles, &normals);
    correspondences_ = {};
    std::vector<Eigen::Vector2d> targets, directions;
    for (int v = 0; v < mesh_.positions.cols(); ++v) {
      const Eigen::Vector3d x = mesh_.positions.col(v).cast<double>();
      const Eigen::Vector3d n = normals.col(v).cast<double>();
      if (std::abs(n.dot(x.normalized())) > 0.05) continue;
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> by_point;
      ASSERT_TRUE(Project(camera_, x, &pixel, &by_point));
      const double aside = 0.03 * std::sin(5 * x.y()) + 0.02;
      directions.emplace_back((by_point * n).normalized());
      targets.emplace_back(pixel + by_point * Eigen::Vector3d(aside, 0, 0));
      correspondences_.vertices.push_back(v);
    }
    const auto count = static_cast<Eigen::Index>(targets.size());
    correspondences_.targets.resize(2, count);
    correspondences_.normals.resize(2, count);
    for (Eigen::Index c = 0; c < count; ++c) {
      correspondences_.targets.col(c) = targets[c];
      correspondences_.normals.col(c) = directions[c];
    }
    start_ = WarpField::Identity(graph_.num_nodes());
    correspondences_.weights.setOnes(count);
    correspondences_.num_boundary = static_cast<int>(count) + 7;
  }

  SurfaceProblem Problem(const SurfaceWeights& weights = {}) const {
    return {camera_, graph_, mesh_.positions, correspondences_, weights, start_};
  }

  WarpField Random(double angle_rad, double length_m) {
    std::normal_distribution<double> normal;
    WarpField field = WarpField::Identity(graph_.num_nodes());
    for (int i = 0; i < graph_.num_nodes(); ++i) {
      field.rotations[i] =
          ExpSO3(angle_rad * Eigen::Vector3d(normal(random_), normal(random_), normal(random_)));
      field.translations.col(i) =
          length_m * Eigen::Vector3d(normal(random_), normal(random_), normal(random_));
    }
    return field;
  }

  // Rigid motion of everything.
  WarpField Rigid(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) const {
    WarpField field = WarpField::Identity(graph_.num_nodes());
    const Eigen::Matrix3Xd nodes = graph_.NodePositions(mesh_.positions);
    for (int i = 0; i < graph_.num_nodes(); ++i) {
      field.rotations[i] = rotation;
      field.translations.col(i) = rotation * nodes.col(i) + translation - nodes.col(i);
    }
    return field;
  }

  // Residuals and Jacobian at random points, every some blocks.
  template <typename Energy>
  void CheckEnergy(const Energy& energy) {
    ASSERT_GT(energy.num_blocks(), 0);
    for (int round = 0; round < 20; ++round) {
      const WarpField at = Random(0.3, 0.05);
      const int block = static_cast<int>(random_() % energy.num_blocks());
      const std::span<const int> nodes = energy.nodes(block);
      const auto evaluate = [&](const Eigen::VectorXd& x) {
        WarpField moved = at;
        for (size_t k = 0; k < nodes.size(); ++k) {
          moved.rotations[nodes[k]] = ExpSO3(x.segment<3>(6 * k)) * at.rotations[nodes[k]];
          moved.translations.col(nodes[k]) += x.segment<3>(6 * k + 3);
        }
        Eigen::VectorXd r(energy.rows());
        EXPECT_TRUE(energy.Evaluate(moved, block, r.data(), nullptr));
        return r;
      };
      const Eigen::VectorXd zero = Eigen::VectorXd::Zero(6 * nodes.size());
      Eigen::VectorXd r(energy.rows());
      BlockJacobian jacobian;
      ASSERT_TRUE(energy.Evaluate(at, block, r.data(), &jacobian));
      EXPECT_EQ(r, evaluate(zero));
      testing::CheckJacobian(
          evaluate, [](const Eigen::VectorXd& x, const Eigen::VectorXd& d) { return x + d; }, zero,
          jacobian, 1e-6);
    }
  }

  TriangleMesh mesh_;
  Camera camera_;
  DeformationGraph graph_;
  WarpField start_;
  Correspondences correspondences_;
  std::mt19937_64 random_{5};
};

TEST_F(SurfaceSolverTest, Jacobians) {
  Prepare(150);
  camera_.distortion = {0.05, -0.02, 0.001, 0.002, 0};
  const SurfaceProblem problem = Problem();
  CheckEnergy(problem.contour);
  CheckEnergy(problem.arap);
  CheckEnergy(problem.drift);
}

TEST_F(SurfaceSolverTest, TermsAreThoseOfThePaper) {
  Prepare(150);
  const WarpField at = Random(0.2, 0.03);
  start_ = Random(0, 0.02);
  const Eigen::Matrix3Xd nodes = graph_.NodePositions(mesh_.positions);
  const double scale = 1000.0 * 1000 / graph_.num_nodes();
  double arap = 0, along = 0, across = 0;
  for (int i = 0; i < graph_.num_nodes(); ++i) {
    for (int e = graph_.neighbor_begin[i]; e < graph_.neighbor_begin[i + 1]; ++e) {
      const int j = graph_.neighbors[e];
      const Eigen::Vector3d gi = nodes.col(i) + at.translations.col(i);
      const Eigen::Vector3d gj = nodes.col(j) + at.translations.col(j);
      arap += scale * (gi - gj - at.rotations[i] * (nodes.col(i) - nodes.col(j))).squaredNorm();
    }
    const Eigen::Vector3d ray = nodes.col(i).normalized();
    along += scale * std::pow(ray.dot(at.translations.col(i)), 2);
    across += scale * ray.cross(at.translations.col(i) - start_.translations.col(i)).squaredNorm();
  }
  Eigen::Matrix3Xf warped;
  WarpVertices(graph_, at, mesh_.positions, &warped);
  double contour = 0;
  for (int c = 0; c < correspondences_.size(); ++c) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(Project(camera_, warped.col(correspondences_.vertices[c]).cast<double>(), &pixel));
    contour +=
        std::pow(correspondences_.normals.col(c).dot(pixel - correspondences_.targets.col(c)), 2);
  }
  contour /= correspondences_.num_boundary;
  const double cost = Problem({0.6, 2, 0.1}).Cost(at);
  EXPECT_NEAR(cost, contour + 0.6 * arap + 2 * along + 0.1 * across, 1e-4 * contour);
  EXPECT_NEAR(Problem({1.2, 2, 0.1}).Cost(at) - cost, 0.6 * arap, 1e-6 * arap);
  EXPECT_NEAR(Problem({0.6, 4, 0.1}).Cost(at) - cost, 2 * along, 1e-6 * along);
  EXPECT_NEAR(Problem({0.6, 2, 0.3}).Cost(at) - cost, 0.2 * across, 1e-6 * across);
  // Half the resolution, the same cost.
  const double full = Problem().Cost(at);
  Prepare(150, 960, 540);
  EXPECT_NEAR(Problem().Cost(at), full, 0.01 * full);
}

TEST_F(SurfaceSolverTest, RestAndRigidMotionsCostNothing) {
  Prepare(150);
  for (int c = 0; c < correspondences_.size(); ++c) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(
        Project(camera_, mesh_.positions.col(correspondences_.vertices[c]).cast<double>(), &pixel));
    correspondences_.targets.col(c) = pixel;
  }
  EXPECT_LT(Problem().Cost(WarpField::Identity(graph_.num_nodes())), 1e-20);
  // Across the ray the contour alone objects to a rigid motion, and without it nothing does.
  correspondences_ = {};
  correspondences_.targets.resize(2, 0);
  correspondences_.normals.resize(2, 0);
  const WarpField moved = Rigid(ExpSO3({0.2, 1, -0.4}), {0.3, 0, 1});
  EXPECT_LT(Problem({0.6, 0, 0}).Cost(moved), 1e-15);
  EXPECT_GT(Problem({0.6, 2, 0}).Cost(moved), 1);
  EXPECT_GT(Problem({0.6, 0, 0.03}).Cost(moved), 1);
}

TEST_F(SurfaceSolverTest, AsGoodAsTheOracle) {
  Prepare(1000);
  for (const SurfaceWeights& weights : {SurfaceWeights{0.6, 2, 0.03}, SurfaceWeights{0.2, 2, 0.01},
                                        SurfaceWeights{0.6, 0, 0}, SurfaceWeights{0.2, 0, 0}}) {
    const SurfaceProblem problem = Problem(weights);
    WarpField field = WarpField::Identity(problem.num_nodes), best = field;
    const SurfaceSolve fast = SolveSurface(problem, 1e-3, 12, &field);
    const SurfaceSolve oracle = SolveSurfaceCeres(problem, 1e-8, 100, &best);
    EXPECT_LT(oracle.final_cost, 0.3 * oracle.initial_cost);
    EXPECT_LT(fast.final_cost, 1.005 * oracle.final_cost);
    EXPECT_DOUBLE_EQ(fast.final_cost, problem.Cost(field));
    EXPECT_DOUBLE_EQ(oracle.final_cost, problem.Cost(best));
    EXPECT_GT(fast.steps, 0);
    for (const Eigen::Matrix3d& rotation : field.rotations) {
      EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
    }
  }
}

TEST_F(SurfaceSolverTest, NeverWorseThanTheStart) {
  Prepare(200);
  const SurfaceProblem problem = Problem();
  for (int round = 0; round < 10; ++round) {
    WarpField field = Random(0.1 * round, 0.02 * round);
    const double before = problem.Cost(field);
    const SurfaceSolve solve = SolveSurface(problem, 1e-3, 5, &field);
    EXPECT_DOUBLE_EQ(solve.initial_cost, before);
    EXPECT_LE(solve.final_cost, before);
    EXPECT_TRUE(field.translations.allFinite());
  }
}

TEST_F(SurfaceSolverTest, OutsideTheDomain) {
  Prepare(100);
  WarpField behind = WarpField::Identity(graph_.num_nodes());
  behind.translations.row(2).setConstant(-9);
  const SurfaceProblem problem = Problem();
  double r = 0;
  EXPECT_FALSE(problem.contour.Evaluate(behind, 0, &r, nullptr));
  EXPECT_TRUE(std::isinf(problem.Cost(behind)));
  WarpField field = behind;
  EXPECT_TRUE(SolveSurface(problem, 1e-3, 5, &field).failed);
  EXPECT_TRUE(SolveSurfaceCeres(problem, 1e-3, 5, &field).failed);
  EXPECT_EQ(field.translations, behind.translations);
}

TEST_F(SurfaceSolverTest, OneNodeAndNoCorrespondences) {
  Prepare(100);
  DeformationGraph& graph = graph_;
  const DeformationGraph large = graph;
  // A single node can only move as a whole.
  TriangleMesh triangle;
  graph = {{0}, Eigen::VectorXf::Ones(1), {0, 0}, {}, {}, {}};
  graph.influences.setZero(1, mesh_.positions.cols());
  graph.weights.setOnes(1, mesh_.positions.cols());
  const SurfaceProblem one = Problem();
  WarpField field = WarpField::Identity(1);
  const SurfaceSolve solve = SolveSurface(one, 1e-3, 20, &field);
  EXPECT_LT(solve.final_cost, solve.initial_cost);
  EXPECT_TRUE(field.translations.allFinite() && field.rotations[0].allFinite());

  graph = large;
  correspondences_ = {};
  correspondences_.targets.resize(2, 0);
  correspondences_.normals.resize(2, 0);
  field = WarpField::Identity(graph.num_nodes());
  EXPECT_EQ(SolveSurface(Problem(), 1e-3, 20, &field).steps, 0);
  EXPECT_EQ(field.translations, WarpField::Identity(graph.num_nodes()).translations);
}

TEST_F(SurfaceSolverTest, MisuseIsRefused) {
  Prepare(100);
  correspondences_.vertices[0] = 1 << 20;
  EXPECT_MPC_ERROR(Problem(), kInvalidArgument, "vertex 1048576");
  correspondences_.vertices[0] = 0;
  correspondences_.num_boundary = 0;
  EXPECT_MPC_ERROR(Problem(), kInvalidArgument, "of 0 boundary vertices");
  correspondences_.num_boundary = 1 << 20;
  correspondences_.weights.resize(2);
  EXPECT_MPC_ERROR(Problem(), kInvalidArgument, "2 weights");
}

}  // namespace
}  // namespace mpc
