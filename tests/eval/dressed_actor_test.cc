#include "mpc/eval/dressed_actor.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc {
namespace {

// The closed body without the seams of its texture.
Triangles BodyTriangles(const DressedActor& actor) {
  const TriangleMesh& mesh = actor.rig.meshes[0].mesh;
  const std::vector<int> welded = WeldedVertices(mesh.positions);
  std::vector<int> corners;
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const int particle =
        actor.cloth.particle.empty() ? -1 : actor.cloth.particle[mesh.triangles(0, t)];
    // A sheet collides; the layers on the body do not.
    const bool sheet = particle >= 0 && !actor.cloth.colliders.empty() &&
                       (actor.cloth.collides[particle] ||
                        actor.cloth.collides[actor.cloth.particle[mesh.triangles(1, t)]] ||
                        actor.cloth.collides[actor.cloth.particle[mesh.triangles(2, t)]]);
    if (sheet) continue;
    for (const int v : mesh.triangles.col(t)) corners.push_back(welded[v]);
  }
  return Eigen::Map<const Triangles>(corners.data(), 3,
                                     static_cast<Eigen::Index>(corners.size()) / 3);
}

// Returns V - E + T: 2 for one sphere.
Eigen::Index ExpectClosedSurface(const Triangles& triangles) {
  std::map<std::pair<int, int>, int> directed;
  std::set<int> vertices;
  for (int t = 0; t < triangles.cols(); ++t) {
    for (int i = 0; i < 3; ++i) {
      ++directed[{triangles(i, t), triangles((i + 1) % 3, t)}];
      vertices.insert(triangles(i, t));
    }
  }
  for (const auto& [edge, count] : directed) {
    EXPECT_EQ(count, 1) << "edge " << edge.first << " " << edge.second;
    EXPECT_EQ(directed.count({edge.second, edge.first}), 1u);
  }
  const auto num_edges = static_cast<Eigen::Index>(directed.size()) / 2;
  return static_cast<Eigen::Index>(vertices.size()) - num_edges + triangles.cols();
}

double SignedVolume(const Eigen::Matrix3Xf& positions, const Triangles& triangles) {
  double volume = 0;
  for (int t = 0; t < triangles.cols(); ++t) {
    const Eigen::Vector3d a = positions.col(triangles(0, t)).cast<double>();
    const Eigen::Vector3d b = positions.col(triangles(1, t)).cast<double>();
    const Eigen::Vector3d c = positions.col(triangles(2, t)).cast<double>();
    volume += a.dot(b.cross(c)) / 6;
  }
  return volume;
}

class DressedActorTest : public ::testing::TestWithParam<Outfit> {
 protected:
  static const DressedActor& actor(Outfit outfit) {  // made once, when asked for
    static std::map<Outfit, DressedActor> actors;
    const auto [it, is_new] = actors.try_emplace(outfit);
    if (is_new) it->second = MakeDressedActor({.outfit = outfit});
    return it->second;
  }
  static const RigMesh& body(Outfit outfit) { return actor(outfit).rig.meshes[0]; }
};

TEST_P(DressedActorTest, IsOneClosedBodyWithOutwardNormals) {
  actor(GetParam()).rig.Validate();
  ASSERT_EQ(actor(GetParam()).rig.meshes.size(), 1u);
  EXPECT_GE(body(GetParam()).mesh.positions.cols(), 6000);
  EXPECT_LE(body(GetParam()).mesh.positions.cols(), 12500);
  const Triangles triangles = BodyTriangles(actor(GetParam()));
  EXPECT_EQ(ExpectClosedSurface(triangles), 2);
  // A person of 1.75 m weighs about 75 kg at the density of water; inside out would be negative.
  const double volume = SignedVolume(body(GetParam()).mesh.positions, triangles);
  EXPECT_GT(volume, 0.05);
  EXPECT_LT(volume, 0.12);
}

TEST_P(DressedActorTest, StandsOnTheFloorAtItsHeight) {
  const Eigen::Matrix3Xf& x = body(GetParam()).mesh.positions;
  EXPECT_NEAR(x.row(1).minCoeff(), 0, 0.003);
  EXPECT_NEAR(x.row(1).maxCoeff(), 1.75, 0.01);
  EXPECT_NEAR(x.row(0).maxCoeff(), -x.row(0).minCoeff(), 0.003);
  EXPECT_NEAR((x.row(0).maxCoeff() - x.row(0).minCoeff()) / 1.75, 1.07, 0.06);
}

TEST_P(DressedActorTest, WeightsAreAPartitionOfUnityAndStayOnTheirSide) {
  const RigAsset& rig = actor(GetParam()).rig;
  const RigMesh& mesh = body(GetParam());
  EXPECT_GE(rig.bones.size(), 20u);
  EXPECT_TRUE(CheckWeights(rig).empty());
  for (int v = 0; v < mesh.weights.cols(); ++v) {
    for (int k = 0; k < mesh.weights.rows(); ++k) {
      if (mesh.weights(k, v) == 0) continue;
      const std::string& bone = rig.bones[mesh.bones(k, v)].name;
      const float x = mesh.mesh.positions(0, v);
      // A sheet's folds hang from both legs.
      const ClothModel& cloth = actor(GetParam()).cloth;
      const bool sheet = !cloth.colliders.empty() && cloth.particle[v] >= 0;
      const float across = sheet ? 0.3F : 0.1F;
      if (bone.starts_with("left")) {
        EXPECT_GT(x, -across) << bone;
      }
      if (bone.starts_with("right")) {
        EXPECT_LT(x, across) << bone;
      }
      if (bone.ends_with("LowerLeg") || bone.ends_with("Foot")) {
        EXPECT_EQ(bone.starts_with("left"), x > 0) << bone;
      }
    }
  }
}

TEST_P(DressedActorTest, TheTextureIsAPictureThatTheMeshStaysInside) {
  const RigMesh& mesh = body(GetParam());
  ASSERT_EQ(mesh.uv.cols(), mesh.mesh.positions.cols());
  EXPECT_GE(mesh.uv.minCoeff(), 0);
  EXPECT_LE(mesh.uv.maxCoeff(), 1);
  const cv::Mat picture = cv::imdecode(mesh.texture, cv::IMREAD_COLOR);
  ASSERT_FALSE(picture.empty());
  // No two triangles share texels: the areas add up to less than the picture, but fill much of it.
  double area = 0;
  for (int t = 0; t < mesh.mesh.triangles.cols(); ++t) {
    const Eigen::Vector2f a = mesh.uv.col(mesh.mesh.triangles(0, t));
    const Eigen::Vector2f b = mesh.uv.col(mesh.mesh.triangles(1, t)) - a;
    const Eigen::Vector2f c = mesh.uv.col(mesh.mesh.triangles(2, t)) - a;
    area += 0.5 * std::abs(b.x() * c.y() - b.y() * c.x());
  }
  EXPECT_GT(area, 0.3);
  EXPECT_LT(area, 0.95);
  // Patterns and shades, not one colour.
  cv::Scalar mean, deviation;
  cv::meanStdDev(picture, mean, deviation);
  EXPECT_GT(deviation[0] + deviation[1] + deviation[2], 60);
}

TEST_P(DressedActorTest, BecomesACharacterWithTheRightProportions) {
  const RigMap map = MapRigByNames(actor(GetParam()).rig);
  for (int part = 0; part < kNumRigParts; ++part) EXPECT_GE(map.bone[part], 0) << part;
  const Character character = BuildCharacter(actor(GetParam()).rig, map);
  const Skeleton expected = DefaultSkeleton(1.75);
  KinematicState rest;
  ForwardKinematics(expected, ZeroPose(expected), &rest);
  const Eigen::Vector3d up(0, (0.245 + 0.246 + 0.039) * 1.75, 0);
  for (int j = 0; j < kNumPaperJoints; ++j) {
    EXPECT_LT((character.bind.joints.col(j) - rest.joints.col(j) - up).norm(), 0.04)
        << JointName(expected.joints[j].id);
  }
}

TEST_P(DressedActorTest, ParticlesAreWelded) {
  const ClothModel& cloth = actor(GetParam()).cloth;
  if (GetParam() == Outfit::kTight) {
    EXPECT_EQ(cloth.num_particles(), 0);
    return;
  }
  ASSERT_EQ(static_cast<Eigen::Index>(cloth.particle.size()),
            body(GetParam()).mesh.positions.cols());
  EXPECT_GT(cloth.num_particles(), 500);
  const std::vector<int> welded = WeldedVertices(body(GetParam()).mesh.positions);
  for (size_t v = 0; v < welded.size(); ++v) {
    EXPECT_EQ(cloth.particle[v], cloth.particle[welded[v]]);
  }
}

INSTANTIATE_TEST_SUITE_P(Outfits, DressedActorTest, ::testing::ValuesIn(kAllOutfits),
                         [](const auto& outfit) { return std::string(OutfitName(outfit.param)); });

TEST_F(DressedActorTest, SameOptionsSameBytesAndSeedsDiffer) {
  const DressedActor again = MakeDressedActor({.outfit = Outfit::kSkirt});
  const RigMesh& first = body(Outfit::kSkirt);
  EXPECT_EQ(again.rig.meshes[0].mesh.positions, first.mesh.positions);
  EXPECT_EQ(again.rig.meshes[0].weights, first.weights);
  EXPECT_EQ(again.rig.meshes[0].texture, first.texture);
  const DressedActor other = MakeDressedActor({.outfit = Outfit::kSkirt, .seed = 4});
  EXPECT_NE(other.rig.bones[7].scene_from_bone.translation(),
            again.rig.bones[7].scene_from_bone.translation());
  EXPECT_NE(other.rig.meshes[0].texture, first.texture);
}

TEST_F(DressedActorTest, ExtremeProportionsStayClosed) {
  for (const double factor : {0.8, 1.25}) {
    DressedActorOptions options{.outfit = Outfit::kCasual, .height_m = 1.2, .build = 1};
    options.girth = options.leg_length = options.arm_length = options.shoulder_width = factor;
    const DressedActor actor = MakeDressedActor(options);
    actor.rig.Validate();
    EXPECT_EQ(ExpectClosedSurface(BodyTriangles(actor)), 2);
    EXPECT_NEAR(actor.rig.meshes[0].mesh.positions.row(1).maxCoeff(), 1.2, 0.01);
    BuildCharacter(actor.rig, MapRigByNames(actor.rig));
  }
}

TEST_F(DressedActorTest, ImpossibleBodiesAreRefused) {
  EXPECT_THROW(MakeDressedActor({.height_m = 0}), Error);
  EXPECT_THROW(MakeDressedActor({.height_m = std::nan("")}), Error);
  EXPECT_THROW(MakeDressedActor({.girth = 5}), Error);
  EXPECT_THROW(MakeDressedActor({.build = -0.1}), Error);
  EXPECT_THROW(MakeDressedActor({.outfit = static_cast<Outfit>(9)}), Error);
  EXPECT_THROW(OutfitName(static_cast<Outfit>(9)), Error);
}

}  // namespace
}  // namespace mpc
