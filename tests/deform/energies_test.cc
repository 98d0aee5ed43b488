// The two energies of pose refinement: their Jacobians, and what they must be.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "deform/posed_actor.h"
#include "mpc/deform/contour_energy.h"
#include "mpc/deform/stability_energy.h"
#include "support/check_jacobian.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Actor;

VectorXd Moved(const VectorXd& pose, const VectorXd& step) {
  VectorXd moved = pose + step;
  moved.segment<3>(3) = LogSO3(ExpSO3(step.segment<3>(3)) * ExpSO3(pose.segment<3>(3)));
  return moved;
}

RefinementPoint PointAt(const VectorXd& pose) {
  RefinementPoint point(Actor());
  point.Set(Actor().skeleton, pose, ExpSO3(pose.segment<3>(3)));
  JointJacobian(Actor().skeleton, point.state, &point.joint_jacobian);
  return point;
}

template <typename Energy>
VectorXd Residuals(const Energy& energy, const VectorXd& pose, MatrixXd* derivative = nullptr) {
  VectorXd r(energy.num_residuals());
  if (derivative != nullptr) derivative->resize(pose.size(), r.size());
  EXPECT_TRUE(energy.Evaluate(PointAt(pose), 0, &r, derivative));
  return r;
}

// What every energy is put through.
template <typename Energy>
void CheckEnergy(const Energy& energy, const VectorXd& around, double tolerance) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const VectorXd pose = testing::Perturbed(around, seed, 0.3, 0.1);
    MatrixXd derivative;
    const VectorXd r = Residuals(energy, pose, &derivative);
    EXPECT_EQ(r, Residuals(energy, pose));
    testing::CheckJacobian([&](const VectorXd& x) { return Residuals(energy, x); }, Moved, pose,
                           derivative.transpose(), tolerance);
  }
}

class PoseEnergies : public ::testing::Test {
 protected:
  // Every 20th vertex against the point where the camera sees it at the truth.
  PoseEnergies() {
    const Eigen::Matrix3Xf vertices = testing::Vertices(Actor(), truth_);
    std::mt19937 rng(5);
    std::normal_distribution<double> normal;
    const Eigen::Index count = vertices.cols() / 20;
    exact_.targets.resize(2, count);
    exact_.normals.resize(2, count);
    exact_.weights.resize(count);
    for (Eigen::Index k = 0; k < count; ++k) {
      const int v = static_cast<int>(20 * k);
      exact_.vertices.push_back(v);
      const VertexSkinner& skinner = at_truth_.skinner;
      exact_.targets.col(k) = testing::PixelOf(camera_, skinner.Position(v));
      exact_.normals.col(k) = Eigen::Vector2d(normal(rng), normal(rng)).normalized();
      exact_.weights[k] = 0.5 + 0.1 * static_cast<double>(k % 10);
    }
    exact_.num_boundary = static_cast<int>(count) + 100;
  }

  Camera camera_ = testing::Camera1080();
  VectorXd truth_ = testing::MidWalk();
  RefinementPoint at_truth_ = PointAt(truth_);
  Correspondences exact_;
};

TEST_F(PoseEnergies, ContourEnergyHasTheRightDerivatives) {
  camera_.distortion = {0.05, -0.02, 0.001, 0.002, 0};
  CheckEnergy(ContourEnergy(camera_, exact_, 0), truth_, 2e-6);
  CheckEnergy(ContourEnergy(camera_, exact_, 30), truth_, 2e-6);
}

TEST_F(PoseEnergies, ContourEnergyIsEquation11) {
  const VectorXd pose = testing::Perturbed(truth_, 1);
  const RefinementPoint point = PointAt(pose);
  exact_.weights.setOnes();
  double sum = 0;
  for (int k = 0; k < exact_.size(); ++k) {
    const Eigen::Vector2d pixel = testing::PixelOf(
        camera_, SkinnedVertex(Actor(), point.state, exact_.vertices[static_cast<size_t>(k)]));
    const double distance = exact_.normals.col(k).dot(pixel - exact_.targets.col(k));
    sum += distance * distance;
  }
  const double energy = Residuals(ContourEnergy(camera_, exact_, 0), pose).squaredNorm();
  EXPECT_GT(energy, 1);
  EXPECT_NEAR(energy, sum / exact_.num_boundary, 1e-9 * energy);
}

TEST_F(PoseEnergies, ContourEnergyVanishesAtTheTruth) {
  EXPECT_LT(Residuals(ContourEnergy(camera_, exact_, 0), truth_).norm(), 1e-9);
  EXPECT_LT(Residuals(ContourEnergy(camera_, exact_, 5), truth_).norm(), 1e-9);
}

TEST_F(PoseEnergies, TwiceTheWeightIsTwiceTheCost) {
  const VectorXd pose = testing::Perturbed(truth_, 2);
  const double contour = Residuals(ContourEnergy(camera_, exact_, 0), pose).squaredNorm();
  exact_.weights *= 2;
  EXPECT_NEAR(Residuals(ContourEnergy(camera_, exact_, 0), pose).squaredNorm(), 2 * contour,
              1e-9 * contour);
  const auto stability = [&](double weight) {
    return Residuals(StabilityEnergy(Actor().skeleton, truth_, weight, 0.9), pose).squaredNorm();
  };
  EXPECT_NEAR(stability(0.12), 2 * stability(0.06), 1e-9 * stability(0.06));
}

TEST_F(PoseEnergies, ContourEnergyDoesNotDependOnTheResolution) {
  const VectorXd pose = testing::Perturbed(truth_, 3);
  const VectorXd full = Residuals(ContourEnergy(camera_, exact_, 20), pose);
  const Camera half = camera_.ScaledTo(960, 540);
  Correspondences scaled = exact_;
  for (int k = 0; k < scaled.size(); ++k) {
    scaled.targets.col(k) = testing::PixelOf(half, at_truth_.skinner.Position(scaled.vertices[k]));
  }
  EXPECT_LT((Residuals(ContourEnergy(half, scaled, 20), pose) - full).norm(), 1e-9 * full.norm());
}

TEST_F(PoseEnergies, TheRobustLossIsBounded) {
  VectorXd far = truth_;
  far[0] += 0.5;
  const double per_row = 400.0 / exact_.num_boundary;
  const VectorXd r = Residuals(ContourEnergy(camera_, exact_, 20), far);
  for (int k = 0; k < r.size(); ++k) EXPECT_LE(r[k] * r[k], per_row * exact_.weights[k] + 1e-12);
  EXPECT_GT(Residuals(ContourEnergy(camera_, exact_, 0), far).squaredNorm(), 4 * r.squaredNorm());
}

TEST_F(PoseEnergies, AVertexBehindTheCameraIsRefused) {
  VectorXd behind = truth_;
  behind[2] = -3;
  VectorXd r(exact_.size());
  EXPECT_FALSE(ContourEnergy(camera_, exact_, 0).Evaluate(PointAt(behind), 0, &r, nullptr));
}

TEST_F(PoseEnergies, StabilityEnergyHasTheRightDerivatives) {
  CheckEnergy(StabilityEnergy(Actor().skeleton, truth_, 0.06, 0), truth_, 1e-6);
  CheckEnergy(StabilityEnergy(Actor().skeleton, truth_, 0.06, 0.9), truth_, 1e-6);
}

TEST_F(PoseEnergies, StabilityEnergyIsEquation12) {
  const StabilityEnergy energy(Actor().skeleton, truth_, 0.06, 0);
  EXPECT_EQ(energy.num_residuals(), 3 * kNumPaperJoints);
  EXPECT_EQ(Residuals(energy, truth_).norm(), 0);
  VectorXd aside = truth_;
  aside.head<3>() += Eigen::Vector3d(0.003, 0, 0.004);  // 5 mm
  EXPECT_NEAR(Residuals(energy, aside).squaredNorm(), 0.06 * 25, 1e-9);
}

// Of the actor as a whole, and of nothing else.
TEST_F(PoseEnergies, StabilityEnergyLeavesDepthFree) {
  const StabilityEnergy energy(Actor().skeleton, truth_, 0.06, 0.9);
  const Eigen::Vector3d ray =
      at_truth_.state.joints.leftCols(kNumPaperJoints).rowwise().mean().normalized();
  const auto moved = [&](const Eigen::Vector3d& step) {
    VectorXd pose = truth_;
    pose.head<3>() += step;
    return Residuals(energy, pose).squaredNorm();
  };
  EXPECT_NEAR(moved(0.005 * ray), 0.01 * 0.06 * 25, 1e-9);
  EXPECT_NEAR(moved(0.005 * ray.unitOrthogonal()), 0.06 * 25, 1e-9);
  VectorXd turned = truth_;
  turned.tail(turned.size() - 6).array() += 0.05;
  const double paper =
      Residuals(StabilityEnergy(Actor().skeleton, truth_, 0.06, 0), turned).squaredNorm();
  EXPECT_GT(Residuals(energy, turned).squaredNorm(), 0.5 * paper);
}

}  // namespace
}  // namespace mpc
