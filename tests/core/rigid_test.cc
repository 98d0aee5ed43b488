#include "mpc/core/rigid.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>
#include <type_traits>

namespace mpc {
namespace {

class RigidTest : public ::testing::Test {
 protected:
  Eigen::Vector3d RandomVector() { return {normal_(rng_), normal_(rng_), normal_(rng_)}; }
  template <typename To, typename From>
  Rigid<To, From> RandomRigid() {
    return {ExpSO3(RandomVector()), RandomVector()};
  }

 private:
  std::mt19937 rng_{7};
  std::normal_distribution<double> normal_;
};

TEST_F(RigidTest, CompositionAppliesRightToLeft) {
  const auto camera_from_world = RandomRigid<CameraFrame, WorldFrame>();
  const auto world_from_actor = RandomRigid<WorldFrame, ActorFrame>();
  const Rigid<CameraFrame, ActorFrame> camera_from_actor = camera_from_world * world_from_actor;
  const Eigen::Vector3d x = RandomVector();
  EXPECT_LT((camera_from_actor * x - camera_from_world * (world_from_actor * x)).norm(), 1e-12);
}

template <typename A, typename B>
concept Composable = requires(A a, B b) {
  a* b;
};

TEST_F(RigidTest, OnlyMatchingFramesCompose) {
  using WorldFromActor = Rigid<WorldFrame, ActorFrame>;
  static_assert(Composable<CameraFromWorld, WorldFromActor>);
  static_assert(!Composable<WorldFromActor, CameraFromWorld>);
  static_assert(!Composable<CameraFromWorld, CameraFromWorld>);
  static_assert(std::is_same_v<decltype(CameraFromWorld().Inverse()),  //
                               Rigid<WorldFrame, CameraFrame>>);
}

TEST_F(RigidTest, InverseUndoes) {
  const auto camera_from_world = RandomRigid<CameraFrame, WorldFrame>();
  const Eigen::Vector3d x = RandomVector();
  EXPECT_LT((camera_from_world.Inverse() * (camera_from_world * x) - x).norm(), 1e-12);
}

TEST_F(RigidTest, LogInvertsExp) {
  for (const double angle : {0.0, 1e-14, 1e-9, 1e-3, 1.0, 3.0, std::numbers::pi - 1e-7}) {
    const Eigen::Vector3d w = angle * RandomVector().normalized();
    const Eigen::Matrix3d rotation = ExpSO3(w);
    EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_NEAR(rotation.determinant(), 1, 1e-12);
    EXPECT_LT((LogSO3(rotation) - w).norm(), 1e-8) << angle;
  }
}

TEST_F(RigidTest, ExpOfASmallVectorIsItsFirstOrder) {
  const Eigen::Vector3d w = 1e-13 * RandomVector(), x = RandomVector();
  EXPECT_LT((ExpSO3(w) * x - x - w.cross(x)).norm(), 1e-15);
}

}  // namespace
}  // namespace mpc
