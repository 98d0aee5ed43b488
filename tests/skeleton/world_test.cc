#include "mpc/skeleton/world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <vector>

#include "mpc/eval/motions.h"
#include "mpc/skeleton/skinning.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

double AngleBetween(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

class WorldTest : public ::testing::Test {
 protected:
  WorldTest() {
    const RigAsset rig = testing::MakeTestRig();
    character_ = BuildCharacter(rig, MapRigByNames(rig));
  }

  // The motion stands in a y-up world; the camera looks down by `pitch` and is rolled.
  Eigen::MatrixXd PosesInCamera(MotionKind kind, double pitch, double roll) {
    camera_ = Camera::FromFov(640, 480, 1);
    camera_.camera_from_world.rotation =
        ExpSO3({0, 0, roll}) * ExpSO3({pitch, 0, 0}) * Vector3d(1, -1, -1).asDiagonal();
    camera_.camera_from_world.translation =
        -(camera_.camera_from_world.rotation * Vector3d(0.3, 1.7, 4));
    const Eigen::MatrixXd poses = MakeMotion(character_.skeleton, kind, 2, 20);
    return TransformPoses(camera_.camera_from_world.rotation, camera_.camera_from_world.translation,
                          poses);
  }

  // The mesh's lowest height in the scene, per frame, sorted.
  std::vector<double> LowestHeights(const Eigen::MatrixXd& poses, const WorldPlacement& placement) {
    const Rigid<SceneFrame, CameraFrame> scene_from_camera = placement.scene_from_camera();
    const Eigen::MatrixXd in_scene =
        TransformPoses(scene_from_camera.rotation, scene_from_camera.translation, poses);
    std::vector<double> heights;
    KinematicState state;
    Eigen::Matrix3Xf vertices;
    for (Eigen::Index f = 0; f < poses.cols(); ++f) {
      ForwardKinematics(character_.skeleton, in_scene.col(f), &state);
      SkinCharacter(character_, state, &vertices);
      heights.push_back(vertices.row(1).minCoeff());
    }
    std::sort(heights.begin(), heights.end());
    return heights;
  }

  Character character_;
  Camera camera_;
};

TEST_F(WorldTest, WithoutExtrinsicsTheSceneIsUprightAndTheActorStandsOnTheFloor) {
  for (const double pitch : {-0.3, 0.0, 0.25, 0.7}) {
    for (const double roll : {0.0, 0.2}) {
      const Eigen::MatrixXd poses = PosesInCamera(MotionKind::kWalk, pitch, roll);
      const Vector3d up_in_camera = camera_.camera_from_world.rotation * Vector3d::UnitY();
      const WorldPlacement placement = PlaceInWorld(character_, poses, camera_);
      EXPECT_LT(AngleBetween(placement.up_in_camera, up_in_camera), 4 * kDegree)
          << "pitch " << pitch << " roll " << roll;
      EXPECT_EQ(placement.num_upright_frames, poses.cols());
      EXPECT_THAT(placement.warnings, ::testing::IsEmpty());

      const Rigid<SceneFrame, CameraFrame> scene = placement.scene_from_camera();
      EXPECT_TRUE((scene.rotation.transpose() * scene.rotation).isIdentity(1e-12));
      EXPECT_NEAR(scene.rotation.determinant(), 1, 1e-12);
      EXPECT_TRUE((scene.rotation * placement.up_in_camera).isApprox(Vector3d::UnitY(), 1e-12));
      // The camera stands over the origin and looks towards -z.
      EXPECT_EQ(scene.translation.x(), 0);
      EXPECT_EQ(scene.translation.z(), 0);
      EXPECT_LT((scene.rotation * Vector3d::UnitZ()).z(), 0);
      EXPECT_NEAR((scene.rotation * Vector3d::UnitZ()).x(), 0, 1e-12);
      EXPECT_TRUE(placement.scene_from_world.rotation.isIdentity(0));

      const std::vector<double> heights = LowestHeights(poses, placement);
      EXPECT_NEAR(heights[(heights.size() - 1) / 5], 0, 1e-5);
    }
  }
}

TEST_F(WorldTest, ExtrinsicsKeepTheirWorldAndAnAxisBecomesExactlyUp) {
  const Eigen::MatrixXd poses = PosesInCamera(MotionKind::kWalk, 0.2, 0);
  const CameraFromWorld y_up = camera_.camera_from_world;
  // The same camera in worlds whose up is z, x, or down along y.
  const std::vector<Matrix3d> y_up_from_world = {
      (Matrix3d() << 1, 0, 0, 0, 0, 1, 0, -1, 0).finished(),
      (Matrix3d() << 0, 1, 0, 1, 0, 0, 0, 0, -1).finished(),
      (Matrix3d() << 1, 0, 0, 0, -1, 0, 0, 0, -1).finished()};
  for (const Matrix3d& rotation : y_up_from_world) {
    ASSERT_EQ(rotation.determinant(), 1);
    camera_.has_extrinsics = true;
    camera_.camera_from_world = y_up;
    camera_.camera_from_world.rotation = y_up.rotation * rotation;
    const WorldPlacement placement = PlaceInWorld(character_, poses, camera_);

    const CameraFromWorld world_and_back = placement.world_from_camera.Inverse();
    EXPECT_TRUE(world_and_back.rotation.isApprox(camera_.camera_from_world.rotation, 1e-12));
    EXPECT_TRUE(world_and_back.translation.isApprox(camera_.camera_from_world.translation, 1e-12));
    const Matrix3d& scene_from_world = placement.scene_from_world.rotation;
    EXPECT_EQ(scene_from_world, Matrix3d(scene_from_world.array().round()));
    EXPECT_EQ(scene_from_world.determinant(), 1);
    const Vector3d up_in_world = rotation.transpose() * Vector3d::UnitY();
    EXPECT_EQ(scene_from_world * up_in_world, Vector3d::UnitY());
    const std::vector<double> heights = LowestHeights(poses, placement);
    EXPECT_NEAR(heights[(heights.size() - 1) / 5], 0, 1e-5);
  }
}

TEST_F(WorldTest, AWorldWithoutAnUprightAxisUsesTheEstimate) {
  const Eigen::MatrixXd poses = PosesInCamera(MotionKind::kWalk, 0.2, 0);
  const Vector3d up_in_camera = camera_.camera_from_world.rotation * Vector3d::UnitY();
  camera_.has_extrinsics = true;
  const Matrix3d skewed = ExpSO3({0.6, 0, 0.5});
  camera_.camera_from_world.rotation = camera_.camera_from_world.rotation * skewed;
  const WorldPlacement placement = PlaceInWorld(character_, poses, camera_);
  EXPECT_LT(AngleBetween(placement.up_in_camera, up_in_camera), 4 * kDegree);
  EXPECT_TRUE((placement.scene_from_camera().rotation * placement.up_in_camera)
                  .isApprox(Vector3d::UnitY(), 1e-9));
}

TEST_F(WorldTest, APersonWhoOnlyLiesLeavesUpToThePicture) {
  Eigen::MatrixXd poses = PosesInCamera(MotionKind::kWalk, 0, 0);
  const Matrix3d lie_down = ExpSO3({0, 0, std::numbers::pi / 2});
  poses = TransformPoses(lie_down, {0, 0, 0}, poses);
  const WorldPlacement placement = PlaceInWorld(character_, poses, camera_);
  EXPECT_EQ(placement.up_in_camera, -Vector3d::UnitY());
  EXPECT_EQ(placement.num_upright_frames, 0);
  EXPECT_THAT(placement.warnings, ::testing::ElementsAre(::testing::HasSubstr("gravity")));
}

TEST_F(WorldTest, AFewFramesOnTheFloorDoNotTiltTheWorld) {
  Eigen::MatrixXd poses = PosesInCamera(MotionKind::kWalk, 0.2, 0);
  const Vector3d expected = PlaceInWorld(character_, poses, camera_).up_in_camera;
  const Eigen::Index third = poses.cols() / 3;
  poses.leftCols(third) =
      TransformPoses(ExpSO3({0, 0, std::numbers::pi / 3}), {0, 0, 0}, poses.leftCols(third));
  const WorldPlacement placement = PlaceInWorld(character_, poses, camera_);
  EXPECT_EQ(placement.num_upright_frames, poses.cols() - third);
  EXPECT_LT(AngleBetween(placement.up_in_camera, expected), 4 * kDegree);
}

TEST_F(WorldTest, DoesNotDependOnTheNumberOfThreads) {
  const Eigen::MatrixXd poses = PosesInCamera(MotionKind::kSquat, 0.2, 0.1);
  const WorldPlacement one = PlaceInWorld(character_, poses, camera_, {}, 1);
  const WorldPlacement three = PlaceInWorld(character_, poses, camera_, {}, 3);
  EXPECT_EQ(one.world_from_camera.rotation, three.world_from_camera.rotation);
  EXPECT_EQ(one.world_from_camera.translation, three.world_from_camera.translation);
}

// A camera that moves, and whose places are known, finds the place that a camera at rest finds.
TEST_F(WorldTest, MovingCameraGivesTheSameWorld) {
  const Eigen::MatrixXd poses = PosesInCamera(MotionKind::kWalk, 0.3, 0.1);
  camera_.has_extrinsics = true;
  const WorldPlacement standing = PlaceInWorld(character_, poses, camera_);
  Eigen::MatrixXd seen(poses.rows(), poses.cols());
  std::vector<CameraFromWorld> motion;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    const double t = 0.05 * static_cast<double>(f);
    const Rigid<CameraFrame, CameraFrame> moved = {
        .rotation = ExpSO3({0.2 * std::sin(t), 0.5 * t, 0.1 * t}),
        .translation = {0.3 * t, 0.1, 0}};
    motion.push_back(moved * camera_.camera_from_world);
    seen.col(f) = TransformPoses(moved.rotation, moved.translation, poses.col(f));
  }
  const WorldPlacement moving = PlaceInWorld(character_, seen, camera_, motion);
  EXPECT_TRUE(moving.scene_from_world.rotation.isApprox(standing.scene_from_world.rotation, 1e-12));
  EXPECT_LT((moving.scene_from_world.translation - standing.scene_from_world.translation).norm(),
            1e-5);
  ASSERT_EQ(moving.moving_world_from_camera.size(), motion.size());
  for (const Eigen::Index f : {Eigen::Index{0}, poses.cols() - 1}) {
    const Vector3d x_standing = standing.scene_from_camera() * Vector3d(poses.col(f).head<3>());
    const Vector3d x_moving = moving.SceneFromCamera(f) * Vector3d(seen.col(f).head<3>());
    EXPECT_LT((x_standing - x_moving).norm(), 1e-5) << f;
  }
  motion.pop_back();
  EXPECT_MPC_ERROR(PlaceInWorld(character_, seen, camera_, motion), kMismatch, "places for");
}

// Turns alone, of a camera that nobody placed: the scene is that of the camera in its first frame.
TEST_F(WorldTest, TurningCameraWithoutExtrinsicsGivesTheSceneOfACameraAtRest) {
  const Eigen::MatrixXd poses = PosesInCamera(MotionKind::kWalk, 0.3, 0.1);
  const WorldPlacement standing = PlaceInWorld(character_, poses, camera_);
  Eigen::MatrixXd seen(poses.rows(), poses.cols());
  std::vector<CameraFromWorld> motion;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    const double t = 0.05 * static_cast<double>(f);
    motion.push_back({.rotation = ExpSO3({0.2 * std::sin(t), 0.2 * t, 0.1 * std::sin(2 * t)})});
    seen.col(f) = TransformPoses(motion.back().rotation, motion.back().translation, poses.col(f));
  }
  const WorldPlacement turning = PlaceInWorld(character_, seen, camera_, motion);
  EXPECT_TRUE(turning.scene_from_world.rotation.isIdentity());
  for (const Eigen::Index f : {Eigen::Index{0}, poses.cols() / 2, poses.cols() - 1}) {
    const Vector3d x_standing = standing.scene_from_camera() * Vector3d(poses.col(f).head<3>());
    const Vector3d x_turning = turning.SceneFromCamera(f) * Vector3d(seen.col(f).head<3>());
    EXPECT_LT((x_standing - x_turning).norm(), 1e-5) << f;
  }
}

}  // namespace
}  // namespace mpc
