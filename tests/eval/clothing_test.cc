#include "mpc/eval/clothing.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "mpc/core/thread_pool.h"
#include "mpc/eval/motions.h"
#include "mpc/skeleton/rig_map.h"
#include "mpc/skeleton/skinning.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Frames = std::vector<Eigen::Matrix3Xf>;

struct Wearer {
  explicit Wearer(Outfit outfit)
      : actor(MakeDressedActor({.outfit = outfit, .build = 1})),
        character(BuildCharacter(actor.rig, MapRigByNames(actor.rig))) {}

  // The bind pose, arms lowered, on the floor.
  Eigen::MatrixXd Standing(int num_frames) const {
    return MakeMotion(character.skeleton, MotionKind::kWave, num_frames, 1)
        .col(0)
        .replicate(1, num_frames);
  }
  Frames Do(const Eigen::MatrixXd& poses, double fps) const {
    return Perform(actor, character, poses, fps);
  }
  Frames Do(MotionKind kind, double seconds, double fps) const {
    return Do(MakeMotion(character.skeleton, kind, seconds, fps), fps);
  }
  // Vertices of the skirt or coat that hang free.
  std::vector<int> FreeVertices() const {
    std::vector<int> vertices;
    for (size_t v = 0; v < actor.cloth.particle.size(); ++v) {
      const int p = actor.cloth.particle[v];
      if (p >= 0 && std::isinf(actor.cloth.freedom_m[p])) vertices.push_back(static_cast<int>(v));
    }
    return vertices;
  }
  // The first vertex of each particle.
  std::vector<int> ParticleVertices() const {
    std::vector<int> vertex(static_cast<size_t>(actor.cloth.num_particles()), 0);
    for (size_t v = actor.cloth.particle.size(); v-- > 0;) {
      if (actor.cloth.particle[v] >= 0) vertex[actor.cloth.particle[v]] = static_cast<int>(v);
    }
    return vertex;
  }

  DressedActor actor;
  Character character;
};

class ClothingTest : public ::testing::Test {
 protected:
  static const Wearer& In(Outfit outfit) {
    static std::map<Outfit, Wearer> wearers;
    return wearers.try_emplace(outfit, outfit).first->second;
  }
  static const Wearer& Skirt() { return In(Outfit::kSkirt); }
};

double LargestMove(const Eigen::Matrix3Xf& a, const Eigen::Matrix3Xf& b) {
  return (a - b).colwise().norm().maxCoeff();
}

// Mean over frames of the mean speed of some vertices, m/s.
double MeanSpeed(const Frames& frames, const std::vector<int>& vertices, size_t begin, size_t end,
                 double fps) {
  double sum = 0;
  for (size_t f = begin + 1; f < end; ++f) {
    const Eigen::Matrix3Xf moved = frames[f] - frames[f - 1];
    for (const int v : vertices) sum += moved.col(v).norm() * fps;
  }
  return sum / static_cast<double>((end - begin - 1) * vertices.size());
}

TEST_F(ClothingTest, AtRestTheClothStays) {
  for (const Outfit outfit : {Outfit::kCasual, Outfit::kSkirt, Outfit::kCoat}) {
    SCOPED_TRACE(OutfitName(outfit));
    const Frames frames = In(outfit).Do(In(outfit).Standing(12), 24);
    EXPECT_LT(LargestMove(frames.front(), frames.back()), 0.008);
  }
}

TEST_F(ClothingTest, TheRestShapeHangsAtBind) {
  // At bind, where the rig has the cloth at rest, the simulation leaves it about there.
  Eigen::MatrixXd poses = Skirt().character.bind_pose.replicate(1, 2);
  const Frames frames = Skirt().Do(poses, 24);
  EXPECT_LT(LargestMove(frames.back(), Skirt().character.mesh.positions), 0.03);
}

TEST_F(ClothingTest, ConstantSpeedCarriesTheClothAlong) {
  Eigen::MatrixXd poses = Skirt().Standing(24);
  for (int f = 0; f < 24; ++f) poses(2, f) += 1.0 * f / 24;
  const Frames moving = Skirt().Do(poses, 24);
  Eigen::Matrix3Xf last = moving.back();
  last.row(2).array() -= 23.0F / 24;
  EXPECT_LT(LargestMove(moving.front(), last), 0.02);
  // The wind of the motion blows it back a little.
  const Frames still = Skirt().Do(Skirt().Standing(1), 24);
  float blown = 0;
  for (const int v : Skirt().FreeVertices()) blown += moving[0](2, v) - still[0](2, v);
  EXPECT_LT(blown / static_cast<float>(Skirt().FreeVertices().size()), -0.003F);
  EXPECT_LT(LargestMove(moving.front(), still.front()), 0.25);
}

// Turns by 120 degrees within a fifth of a second, then stands still.
Eigen::MatrixXd SuddenTurn(const Wearer& wearer, int num_frames, double fps) {
  const Eigen::MatrixXd standing = wearer.Standing(num_frames);
  Eigen::MatrixXd poses = standing;
  for (int f = 0; f < num_frames; ++f) {
    const double t = std::clamp((f / fps - 0.2) / 0.2, 0.0, 1.0);
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(t * 2.0 / 3 * std::numbers::pi, Eigen::Vector3d::UnitY())
            .toRotationMatrix();
    poses.col(f) = TransformPoses(turn, Eigen::Vector3d::Zero(), standing.col(f));
  }
  return poses;
}

TEST_F(ClothingTest, LagsBehindASuddenTurnAndSwingsOut) {
  const double fps = 30;
  const Eigen::MatrixXd poses = SuddenTurn(Skirt(), 75, fps);
  const Frames frames = Skirt().Do(poses, fps);
  const std::vector<int> free = Skirt().FreeVertices();
  // Mean angle about the vertical that the cloth is behind its skinned place.
  const auto lag = [&](int f) {
    KinematicState state;
    ForwardKinematics(Skirt().character.skeleton, poses.col(f), &state);
    Eigen::Matrix3Xf skinned;
    SkinCharacter(Skirt().character, state, &skinned);
    double sum = 0;
    for (const int v : free) {
      const Eigen::Vector3d a =
          (frames[f].col(v) - state.origins.col(0).cast<float>()).cast<double>();
      const Eigen::Vector3d b =
          (skinned.col(v) - state.origins.col(0).cast<float>()).cast<double>();
      sum += std::atan2(a.z() * b.x() - a.x() * b.z(), a.x() * b.x() + a.z() * b.z());
    }
    return sum / static_cast<double>(free.size());
  };
  EXPECT_GT(lag(10), lag(5) + 0.25);
  EXPECT_LT(std::abs(lag(74) - lag(5)), 0.12);

  // Energy does not grow once the body stands still.
  double before = std::numeric_limits<double>::infinity();
  for (const size_t begin : {15u, 30u, 45u, 60u}) {
    const double speed = MeanSpeed(frames, free, begin, begin + 15, fps);
    EXPECT_LT(speed, 0.8 * before) << begin;
    before = speed;
  }
}

TEST_F(ClothingTest, LengthensHardly) {
  for (const Outfit outfit : {Outfit::kSkirt, Outfit::kCoat}) {
    SCOPED_TRACE(OutfitName(outfit));
    const Wearer& wearer = In(outfit);
    const std::vector<int> vertex = wearer.ParticleVertices();
    std::vector<double> strains;
    for (const Eigen::Matrix3Xf& x : wearer.Do(MotionKind::kWalk, 1.2, 30)) {
      for (const ClothModel::Link& link : wearer.actor.cloth.stretch) {
        if (!std::isinf(wearer.actor.cloth.freedom_m[link.b])) continue;
        strains.push_back((x.col(vertex[link.a]) - x.col(vertex[link.b])).norm() / link.rest_m - 1);
      }
    }
    std::sort(strains.begin(), strains.end());
    EXPECT_NEAR(strains[strains.size() / 2], 0, 0.005);
    EXPECT_LT(strains[strains.size() * 9 / 10], 0.025);
    EXPECT_LT(strains[strains.size() * 99 / 100], 0.065);
    EXPECT_GT(strains[strains.size() / 100], -0.045);
  }
}

TEST_F(ClothingTest, StaysOutsideOfTheBody) {
  for (const auto& [outfit, kind] : {std::pair{Outfit::kSkirt, MotionKind::kWalk},
                                     {Outfit::kSkirt, MotionKind::kKick},
                                     {Outfit::kCoat, MotionKind::kSquat}}) {
    SCOPED_TRACE(OutfitName(outfit));
    const Wearer& wearer = In(outfit);
    const Eigen::MatrixXd poses = MakeMotion(wearer.character.skeleton, kind, 1.3, 30);
    const Frames frames = wearer.Do(poses, 30);
    const std::vector<int> free = wearer.FreeVertices();
    double deepest = 0;
    KinematicState state;
    std::vector<Eigen::Affine3d> body_from_bone;
    for (size_t f = 0; f < frames.size(); ++f) {
      ForwardKinematics(wearer.character.skeleton, poses.col(static_cast<int>(f)), &state);
      for (const ClothModel::Collider& collider : wearer.actor.cloth.colliders) {
        const int segment = wearer.character.bone_segment[collider.bone];
        const Eigen::Matrix3d rotation =
            wearer.character.bind.rotations[segment] * state.rotations[segment].transpose();
        for (const int v : free) {
          const Eigen::Vector3d x =
              rotation * (frames[f].col(v).cast<double>() - state.origins.col(segment)) +
              wearer.character.bind.origins.col(segment);
          const Eigen::Vector3d along = collider.capsule.b - collider.capsule.a;
          const double s =
              along.isZero()
                  ? 0
                  : std::clamp(along.dot(x - collider.capsule.a) / along.squaredNorm(), 0.0, 1.0);
          const double radius = collider.capsule.radius_a +
                                s * (collider.capsule.radius_b - collider.capsule.radius_a);
          deepest = std::max(deepest, radius - (x - collider.capsule.a - s * along).norm());
        }
      }
      for (const int v : free) EXPECT_GE(frames[f](1, v), 0);
    }
    EXPECT_LT(deepest, 0.004);
  }
}

TEST_F(ClothingTest, IsTheSameInAnyThread) {
  std::vector<Frames> runs(3);
  ParallelFor(3, 3, [&](int i) { runs[i] = Skirt().Do(MotionKind::kWalk, 0.2, 30); });
  for (size_t f = 0; f < runs[0].size(); ++f) {
    EXPECT_EQ(runs[0][f], runs[1][f]);
    EXPECT_EQ(runs[0][f], runs[2][f]);
  }
}

TEST_F(ClothingTest, StaysFiniteAndNearAtAnyRate) {
  for (const auto& [fps, kind] :
       {std::pair{5.0, MotionKind::kJump}, {24.0, MotionKind::kRoll}, {240.0, MotionKind::kJump}}) {
    SCOPED_TRACE(fps);
    const Eigen::MatrixXd poses = MakeMotion(Skirt().character.skeleton, kind, 1.4, fps);
    const Frames frames = Skirt().Do(poses, fps);
    for (size_t f = 0; f < frames.size(); ++f) {
      ASSERT_TRUE(frames[f].allFinite());
      const Eigen::Vector3f root = poses.col(static_cast<int>(f)).head<3>().cast<float>();
      EXPECT_LT((frames[f].colwise() - root).colwise().norm().maxCoeff(), 1.4F);
    }
  }
}

TEST_F(ClothingTest, JumpsBetweenFramesAreSurvived) {
  Eigen::MatrixXd poses = Skirt().Standing(6);
  poses(0, 3) += 50;  // a glitch
  poses.col(4).segment<3>(3) << 3, 0, 0;
  for (const Eigen::Matrix3Xf& frame : Skirt().Do(poses, 30)) EXPECT_TRUE(frame.allFinite());
}

TEST_F(ClothingTest, WithoutClothItIsPlainSkinning) {
  const DressedActor user{testing::MakeTestRig(), {}};
  const Character character = BuildCharacter(user.rig, MapRigByNames(user.rig));
  const Eigen::MatrixXd poses = MakeMotion(character.skeleton, MotionKind::kWalk, 0.2, 10);
  const Frames frames = Perform(user, character, poses, 10);
  ASSERT_EQ(frames.size(), 2u);
  KinematicState state;
  ForwardKinematics(character.skeleton, poses.col(1), &state);
  Eigen::Matrix3Xf skinned;
  SkinCharacter(character, state, &skinned);
  EXPECT_EQ(frames[1], skinned);
}

TEST_F(ClothingTest, WhatDoesNotFitIsRefused) {
  const RigAsset other = testing::MakeTestRig();
  const Character character = BuildCharacter(other, MapRigByNames(other));
  const Eigen::MatrixXd poses = Skirt().Standing(2);
  EXPECT_MPC_ERROR(Perform(Skirt().actor, character, poses, 30), kMismatch, "vertices");
  EXPECT_MPC_ERROR(Skirt().Do(poses.topRows(10), 30), kInvalidArgument, "poses");
  EXPECT_MPC_ERROR(Skirt().Do(poses, 0), kInvalidArgument, "fps");
  EXPECT_MPC_ERROR(Skirt().Do(poses, std::nan("")), kInvalidArgument, "fps");
  Eigen::MatrixXd broken = poses;
  broken(7, 1) = std::nan("");
  EXPECT_MPC_ERROR(Skirt().Do(broken, 30), kInvalidArgument, "poses");
  EXPECT_TRUE(Skirt().Do(poses.leftCols(0), 30).empty());
}

}  // namespace
}  // namespace mpc
