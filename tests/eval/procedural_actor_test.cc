#include "mpc/eval/procedural_actor.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc {
namespace {

double SignedVolume(const TriangleMesh& mesh) {
  double volume = 0;
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const Eigen::Vector3d a = mesh.positions.col(mesh.triangles(0, t)).cast<double>();
    const Eigen::Vector3d b = mesh.positions.col(mesh.triangles(1, t)).cast<double>();
    const Eigen::Vector3d c = mesh.positions.col(mesh.triangles(2, t)).cast<double>();
    volume += a.dot(b.cross(c)) / 6;
  }
  return volume;
}

class ProceduralActorTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { rig_ = new RigAsset(ProceduralActor()); }
  static void TearDownTestSuite() { delete rig_; }
  static const TriangleMesh& mesh() { return rig_->meshes[0].mesh; }
  static RigAsset* rig_;
};
RigAsset* ProceduralActorTest::rig_ = nullptr;

TEST_F(ProceduralActorTest, IsOneWatertightBodyWithOutwardNormals) {
  rig_->Validate();
  ASSERT_EQ(rig_->meshes.size(), 1u);
  EXPECT_GE(rig_->num_vertices(), 3000);
  EXPECT_LE(rig_->num_vertices(), 7000);
  std::map<std::pair<int, int>, int> directed;
  for (int t = 0; t < mesh().triangles.cols(); ++t) {
    for (int i = 0; i < 3; ++i) {
      ++directed[{mesh().triangles(i, t), mesh().triangles((i + 1) % 3, t)}];
    }
  }
  for (const auto& [edge, count] : directed) {
    ASSERT_EQ(count, 1) << "edge " << edge.first << " " << edge.second;
    ASSERT_EQ(directed.count({edge.second, edge.first}), 1u);
  }
  const int num_edges = static_cast<int>(directed.size()) / 2;
  EXPECT_EQ(mesh().positions.cols() - num_edges + mesh().triangles.cols(), 2) << "one sphere";
  // A person of 1.75 m weighs about 70 kg at the density of water; inside out would be negative.
  EXPECT_GT(SignedVolume(mesh()), 0.05);
  EXPECT_LT(SignedVolume(mesh()), 0.11);
}

TEST_F(ProceduralActorTest, StandsOnTheFloorAtItsHeight) {
  EXPECT_NEAR(mesh().positions.row(1).minCoeff(), 0, 0.003);
  EXPECT_NEAR(mesh().positions.row(1).maxCoeff(), 1.75, 0.01);
  EXPECT_NEAR(mesh().positions.row(0).maxCoeff(), -mesh().positions.row(0).minCoeff(), 0.003);
  const double span = mesh().positions.row(0).maxCoeff() - mesh().positions.row(0).minCoeff();
  EXPECT_NEAR(span / 1.75, 1.05, 0.06);
}

TEST_F(ProceduralActorTest, WeightsAreAPartitionOfUnityAndStayOnTheirSide) {
  const RigMesh& body = rig_->meshes[0];
  EXPECT_TRUE(CheckWeights(*rig_).empty());
  for (int v = 0; v < body.weights.cols(); ++v) {
    for (int k = 0; k < body.weights.rows(); ++k) {
      if (body.weights(k, v) == 0) continue;
      const std::string& bone = rig_->bones[body.bones(k, v)].name;
      const float x = body.mesh.positions(0, v);
      if (bone.starts_with("left")) {
        EXPECT_GT(x, -0.1) << bone;
      }
      if (bone.starts_with("right")) {
        EXPECT_LT(x, 0.1) << bone;
      }
      if (bone.ends_with("LowerLeg") || bone.ends_with("Foot")) {
        EXPECT_EQ(bone.starts_with("left"), x > 0) << bone;
      }
    }
  }
  EXPECT_EQ(body.uv.cols(), body.weights.cols());
  EXPECT_GE(body.uv.minCoeff(), 0);
  EXPECT_LE(body.uv.maxCoeff(), 1);
}

TEST_F(ProceduralActorTest, BecomesACharacterWithTheRightProportions) {
  const RigMap map = MapRigByNames(*rig_);
  for (int part = 0; part < kNumRigParts; ++part) EXPECT_GE(map.bone[part], 0) << part;
  const Character character = BuildCharacter(*rig_, map);
  const Skeleton expected = DefaultSkeleton(1.75);
  KinematicState rest;
  ForwardKinematics(expected, ZeroPose(expected), &rest);
  const Eigen::Vector3d up(0, (0.245 + 0.246 + 0.039) * 1.75, 0);
  for (int j = 0; j < kNumPaperJoints; ++j) {
    EXPECT_LT((character.bind.joints.col(j) - rest.joints.col(j) - up).norm(), 0.04)
        << JointName(expected.joints[j].id);
  }
}

TEST_F(ProceduralActorTest, SameOptionsSameBytes) {
  const RigAsset again = ProceduralActor();
  EXPECT_EQ(again.meshes[0].mesh.positions, mesh().positions);
  EXPECT_EQ(again.meshes[0].weights, rig_->meshes[0].weights);
  ProceduralActorOptions options;
  options.seed = 4;
  EXPECT_NE(ProceduralActor(options).bones[7].scene_from_bone.translation(),
            rig_->bones[7].scene_from_bone.translation());
}

TEST_F(ProceduralActorTest, ExtremeProportionsStayOneSurface) {
  for (const double factor : {0.8, 1.25}) {
    ProceduralActorOptions options;
    options.height_m = 1.2;
    options.girth = options.leg_length = options.arm_length = options.shoulder_width = factor;
    const RigAsset rig = ProceduralActor(options);
    rig.Validate();
    std::map<std::pair<int, int>, int> edges;
    const Triangles& triangles = rig.meshes[0].mesh.triangles;
    for (int t = 0; t < triangles.cols(); ++t) {
      for (int i = 0; i < 3; ++i) ++edges[{triangles(i, t), triangles((i + 1) % 3, t)}];
    }
    for (const auto& [edge, count] : edges) {
      ASSERT_EQ(count, 1);
      ASSERT_EQ(edges.count({edge.second, edge.first}), 1u);
    }
    EXPECT_NEAR(rig.meshes[0].mesh.positions.row(1).maxCoeff(), 1.2, 0.01);
    BuildCharacter(rig, MapRigByNames(rig));
  }
}

TEST_F(ProceduralActorTest, ImpossibleBodiesAreRefused) {
  ProceduralActorOptions options;
  options.height_m = 0;
  EXPECT_THROW(ProceduralActor(options), Error);
  options.height_m = std::nan("");
  EXPECT_THROW(ProceduralActor(options), Error);
  options = {};
  options.girth = 5;
  EXPECT_THROW(ProceduralActor(options), Error);
}

}  // namespace
}  // namespace mpc
