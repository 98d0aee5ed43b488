#include "mpc/eval/synthetic_performance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/eval/dressed_actor.h"
#include "mpc/eval/motions.h"
#include "mpc/eval/stool.h"
#include "mpc/render/lit_scene.h"
#include "mpc/render/raster.h"
#include "mpc/skeleton/rig_map.h"
#include "mpc/skeleton/skinning.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

constexpr double kFps = 10;

class SyntheticPerformanceTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    rig_ = new RigAsset(MakeDressedActor().rig);
    character_ = new Character(BuildCharacter(*rig_, MapRigByNames(*rig_)));
  }
  static void TearDownTestSuite() {
    delete character_;
    delete rig_;
  }
  // A walk of 8 frames.
  static Acting Walk() {
    const Eigen::MatrixXd poses = MakeMotion(character_->skeleton, MotionKind::kWalk, 0.8, kFps);
    return ActWithSkinning(*character_, poses, kFps, 1);
  }
  static Acting StandStill() {
    const Eigen::MatrixXd poses = MakeMotion(character_->skeleton, MotionKind::kWalk, 0.1, kFps);
    return ActWithSkinning(*character_, poses.col(0).replicate(1, 3), kFps, 1);
  }
  static PerformanceOptions Options(CameraMotion motion) {
    PerformanceOptions options;
    options.camera.width = 160;
    options.camera.height = 120;
    options.camera.motion = motion;
    options.scene.sensor_noise = 0;
    options.scene.samples = 2;
    return options;
  }
  static std::vector<RenderedFrame> Render(const SyntheticPerformance& performance,
                                           int num_threads = 1) {
    std::vector<RenderedFrame> frames;
    const auto scene = MakeScene(performance, *rig_, *character_);
    EXPECT_TRUE(RenderPerformance(performance, *scene, num_threads, [&](const RenderedFrame& f) {
      frames.push_back({f.index, f.bgr.clone(), f.mask.clone()});
    }));
    return frames;
  }
  static RigAsset* rig_;
  static Character* character_;
};
RigAsset* SyntheticPerformanceTest::rig_ = nullptr;
Character* SyntheticPerformanceTest::character_ = nullptr;

TEST_F(SyntheticPerformanceTest, MasksAreTheRasterisedVertices) {
  for (const CameraMotion motion : kAllCameraMotions) {
    const SyntheticPerformance performance = MakePerformance(*character_, Walk(), Options(motion));
    EXPECT_EQ(performance.camera.motion.empty(), motion == CameraMotion::kStatic);
    for (const RenderedFrame& frame : Render(performance)) {
      const Camera camera = performance.camera.InFrame(frame.index);
      const cv::Mat mask = MeshMask(
          camera, ToCamera(camera.camera_from_world, performance.acting.vertices[frame.index]),
          character_->mesh.triangles);
      ASSERT_GT(cv::countNonZero(mask), 300);
      EXPECT_EQ(cv::countNonZero(mask != frame.mask), 0);
    }
  }
}

TEST_F(SyntheticPerformanceTest, OccludersAreTakenOutOfTheMask) {
  PerformanceOptions options = Options(CameraMotion::kHandheld);
  options.scene.occluders = true;
  const SyntheticPerformance performance = MakePerformance(*character_, StandStill(), options);
  const auto scene = MakeScene(performance, *rig_, *character_);
  const Camera camera = performance.camera.InFrame(1);
  const Eigen::Matrix3Xf& vertices = performance.acting.vertices[1];
  const cv::Mat actor =
      MeshMask(camera, ToCamera(camera.camera_from_world, vertices), character_->mesh.triangles);
  // They stand in front of the actor, so they hide all that they cover.
  const cv::Mat post =
      MeshMask(camera, ToCamera(camera.camera_from_world, scene->occluders().positions),
               scene->occluders().triangles);
  const cv::Mat mask = scene->Mask(camera, {vertices, camera.camera_from_world});
  EXPECT_EQ(cv::countNonZero(mask != (actor & ~post)), 0);
  EXPECT_GT(cv::countNonZero(actor & post), 20);
  EXPECT_GT(cv::countNonZero(mask), cv::countNonZero(actor) / 2);
}

// The body, above the feet, is never in the stool but where it sits: it touches the seat.
TEST_F(SyntheticPerformanceTest, SittingIsOnAStoolThatHidesWhatIsBehindIt) {
  const Eigen::MatrixXd poses = MakeMotion(character_->skeleton, MotionKind::kSit, 2, kFps);
  Acting acting = ActWithSkinning(*character_, poses, kFps, 1);
  DressedActor actor;
  actor.rig = *rig_;
  const Stool stool = StoolUnder(actor, *character_, acting.poses.col(0));
  EXPECT_GT(stool.top.y(), 0.35);
  EXPECT_LT(stool.top.y(), 0.55);
  double sunk = 0;
  for (const Eigen::Matrix3Xf& vertices : acting.vertices) {
    for (const auto& x : vertices.colwise()) {
      const Eigen::Vector3d from_top = x.cast<double>() - stool.top;
      const double half = 0.5 * stool.side_m;
      if (std::abs(from_top.x()) > half || std::abs(from_top.z()) > half) continue;
      sunk = std::max(sunk, -from_top.y());
    }
  }
  EXPECT_NEAR(sunk, 0.01, 0.002);

  // A clip that ends before has the stool at the same place, seen from where it starts.
  const Acting early = ActWithSkinning(
      *character_, MakeMotion(character_->skeleton, MotionKind::kSit, 0.3, kFps), kFps, 1);
  const Stool same = StoolUnder(actor, *character_, early.poses.col(0));
  const Eigen::Vector3d moved = (early.poses.col(0) - acting.poses.col(0)).head<3>();
  EXPECT_LT((same.top - stool.top - moved).norm(), 0.002);

  // Seen from behind, the stool hides a part of the legs.
  acting.stool = stool;
  const Eigen::Matrix3d turn = ExpSO3({0, std::numbers::pi, 0});
  acting.stool->top = turn * stool.top;
  acting.poses = TransformPoses(turn, Eigen::Vector3d::Zero(), acting.poses);
  for (Eigen::Matrix3Xf& vertices : acting.vertices) vertices = turn.cast<float>() * vertices;
  PerformanceOptions options = Options(CameraMotion::kStatic);
  const SyntheticPerformance on = MakePerformance(*character_, acting, options);
  acting.stool.reset();
  const SyntheticPerformance off = MakePerformance(*character_, acting, options);
  const auto with = MakeScene(on, *rig_, *character_), without = MakeScene(off, *rig_, *character_);
  EXPECT_GT(with->occluders().positions.cols(), 0);
  EXPECT_EQ(without->occluders().positions.cols(), 0);
  const SceneMoment moment{on.acting.vertices.back(), on.camera.At(0)};
  const cv::Mat seen = with->Mask(on.camera.camera, moment);
  const cv::Mat all = without->Mask(on.camera.camera, moment);
  EXPECT_EQ(cv::countNonZero(seen & ~all), 0);
  EXPECT_GT(cv::countNonZero(all & ~seen), 20);
  EXPECT_GT(cv::countNonZero(seen), 0.7 * cv::countNonZero(all));
}

TEST_F(SyntheticPerformanceTest, AStoolNeedsRoom) {
  DressedActor actor;
  actor.rig = *rig_;
  Eigen::VectorXd low = MakeMotion(character_->skeleton, MotionKind::kSit, 0.1, kFps).col(0);
  low[1] -= 0.4;
  EXPECT_MPC_ERROR(StoolUnder(actor, *character_, low), kUnsupported, "no room for a stool");
}

TEST_F(SyntheticPerformanceTest, TheBackgroundOfACameraAtRestIsStill) {
  PerformanceOptions options = Options(CameraMotion::kStatic);
  options.scene.moving_background = false;
  const std::vector<RenderedFrame> frames = Render(MakePerformance(*character_, Walk(), options));
  // Far from actor and shadow: the upper corners.
  const cv::Rect corners[] = {{0, 0, 40, 40}, {120, 0, 40, 40}};
  for (const cv::Rect& corner : corners) {
    for (const RenderedFrame& frame : frames) {
      EXPECT_EQ(cv::norm(frames[0].bgr(corner), frame.bgr(corner), cv::NORM_INF), 0);
    }
  }
  EXPECT_GT(cv::norm(frames[0].bgr, frames[7].bgr, cv::NORM_INF), 50) << "the actor walks";
}

TEST_F(SyntheticPerformanceTest, ACameraAtRestSeesTheSameWhetherThePlaceIsKeptOrNot) {
  for (const PlaceKind place : kAllPlaces) {
    PerformanceOptions options = Options(CameraMotion::kStatic);
    options.scene.place = place;
    options.scene.occluders = true;
    SyntheticPerformance performance = MakePerformance(*character_, Walk(), options);
    const std::vector<RenderedFrame> kept = Render(performance);
    // A list of equal places is a moving camera.
    performance.camera.motion.resize(8, performance.camera.camera.camera_from_world);
    const std::vector<RenderedFrame> anew = Render(performance);
    for (size_t f = 0; f < kept.size(); ++f) {
      // Floats are rounded otherwise where a row of pixels begins elsewhere; a shadow's rim may change.
      const cv::Mat different = cv::abs(kept[f].bgr - anew[f].bgr) > 1;
      EXPECT_LT(cv::countNonZero(different.reshape(1)), 20) << PlaceName(place) << " " << f;
    }
  }
}

TEST_F(SyntheticPerformanceTest, MovingThingsMove) {
  PerformanceOptions options = Options(CameraMotion::kStatic);
  for (const PlaceKind place : kAllPlaces) {
    options.scene.place = place;
    double change[2];
    for (const bool moving : {false, true}) {
      options.scene.moving_background = moving;
      const std::vector<RenderedFrame> frames =
          Render(MakePerformance(*character_, StandStill(), options));
      change[moving] = cv::norm(frames[0].bgr, frames[2].bgr, cv::NORM_L1);
    }
    EXPECT_EQ(change[0], 0) << PlaceName(place);
    EXPECT_GT(change[1], 500) << PlaceName(place);
  }
}

TEST_F(SyntheticPerformanceTest, BlurOfAStillSceneChangesNothing) {
  PerformanceOptions options = Options(CameraMotion::kStatic);
  options.scene.moving_background = false;
  options.scene.shutter = 0;
  const std::vector<RenderedFrame> sharp =
      Render(MakePerformance(*character_, StandStill(), options));
  options.scene.shutter = 1;
  const std::vector<RenderedFrame> blurred =
      Render(MakePerformance(*character_, StandStill(), options));
  EXPECT_EQ(cv::norm(sharp[1].bgr, blurred[1].bgr, cv::NORM_INF), 0);
  const std::vector<RenderedFrame> moving = Render(MakePerformance(*character_, Walk(), options));
  options.scene.shutter = 0;
  const std::vector<RenderedFrame> frozen = Render(MakePerformance(*character_, Walk(), options));
  EXPECT_GT(cv::norm(moving[3].bgr, frozen[3].bgr, cv::NORM_INF), 10);
  EXPECT_EQ(cv::norm(moving[3].mask, frozen[3].mask, cv::NORM_INF), 0) << "masks are sharp";
}

TEST_F(SyntheticPerformanceTest, AveragedPicturesLieWhereThePixelsCentresSay) {
  PerformanceOptions options = Options(CameraMotion::kStatic);
  options.scene.moving_background = false;
  options.scene.sensor_noise = 0;
  options.scene.shutter = 0;
  const auto picture = [&](int samples) {
    options.scene.samples = samples;
    cv::Mat grey;
    cv::cvtColor(Render(MakePerformance(*character_, StandStill(), options))[0].bgr, grey,
                 cv::COLOR_BGR2GRAY);
    grey.convertTo(grey, CV_64F);
    return grey;
  };
  const cv::Mat smooth = picture(64);
  for (const int samples : {3, 4, 5}) {
    const cv::Point2d shift = cv::phaseCorrelate(smooth, picture(samples));
    EXPECT_NEAR(shift.x, 0, 0.03) << samples;
    EXPECT_NEAR(shift.y, 0, 0.03) << samples;
  }
}

TEST_F(SyntheticPerformanceTest, TheWholeActorIsSeen) {
  for (const CameraMotion motion : kAllCameraMotions) {
    for (const bool portrait : {false, true}) {
      PerformanceOptions options = Options(motion);
      if (portrait) std::swap(options.camera.width, options.camera.height);
      options.camera.fov_rad = portrait ? 0.6 : 1.5;
      const SyntheticPerformance performance = MakePerformance(*character_, Walk(), options);
      for (int f = 0; f < performance.num_frames(); ++f) {
        const Camera camera = performance.camera.InFrame(f);
        const Eigen::Matrix3Xf x =
            ToCamera(camera.camera_from_world, performance.acting.vertices[f]);
        const cv::Rect bounds = ProjectedBounds(camera, x);
        EXPECT_GE(bounds.x, 3);
        EXPECT_GE(bounds.y, 3);
        EXPECT_LE(bounds.br().x, camera.width - 3);
        EXPECT_LE(bounds.br().y, camera.height - 3);
        EXPECT_GT(bounds.height, camera.height / 4);
        EXPECT_GT(camera.camera_from_world.Inverse().translation.y(), 0.2);
      }
    }
  }
}

TEST_F(SyntheticPerformanceTest, JointsLieInsideTheMask) {
  const SyntheticPerformance performance =
      MakePerformance(*character_, Walk(), Options(CameraMotion::kHandheld));
  for (const RenderedFrame& frame : Render(performance)) {
    const Camera camera = performance.camera.InFrame(frame.index);
    cv::Mat wide;  // a joint may lie on the rim: head top, toes
    cv::blur(frame.mask, wide, {5, 5});
    for (int j = 0; j < kNumPaperJoints; ++j) {
      Eigen::Vector2d pixel;
      const Eigen::Vector3d x = performance.joints.col(frame.index).segment<3>(3 * j);
      ASSERT_TRUE(Project(camera, camera.camera_from_world * x, &pixel));
      EXPECT_GT(wide.at<uchar>(cvRound(pixel.y()), cvRound(pixel.x())), 0)
          << JointName(static_cast<JointId>(j)) << " in frame " << frame.index;
    }
  }
}

TEST_F(SyntheticPerformanceTest, DetectionsFollowTheMovingCamera) {
  PerformanceOptions options = Options(CameraMotion::kHandheld);
  options.errors = DetectionErrors::kExact;
  const SyntheticPerformance performance = MakePerformance(*character_, Walk(), options);
  ASSERT_EQ(performance.detections.detections2d.frames.size(), 8u);
  for (int f = 0; f < 8; ++f) {
    const Camera camera = performance.camera.InFrame(f);
    for (int j = 0; j < kNumPaperJoints; ++j) {
      Eigen::Vector2d pixel;
      const Eigen::Vector3d x = performance.joints.col(f).segment<3>(3 * j);
      ASSERT_TRUE(Project(camera, camera.camera_from_world * x, &pixel));
      EXPECT_LT((performance.detections.detections2d.frames[f].pixels.col(j) - pixel).norm(), 1e-6);
    }
  }
  options.errors = DetectionErrors::kOff;
  EXPECT_TRUE(MakePerformance(*character_, Walk(), options).detections.detections2d.frames.empty());
}

TEST_F(SyntheticPerformanceTest, AHandheldCameraMovesSmoothly) {
  Acting acting = StandStill();
  acting.poses = acting.poses.col(0).replicate(1, 60).eval();
  acting.vertices.resize(60, acting.vertices[0]);
  acting.fps = 30;
  SyntheticCameraOptions options;
  options.motion = CameraMotion::kHandheld;
  const SyntheticCamera camera = MakeSyntheticCamera(acting.vertices, 30, options);
  double turn = 0, jerk = 0;
  for (int f = 1; f + 1 < 60; ++f) {
    const Eigen::Vector3d before =
        LogSO3(camera.motion[f].rotation * camera.motion[f - 1].rotation.transpose());
    const Eigen::Vector3d after =
        LogSO3(camera.motion[f + 1].rotation * camera.motion[f].rotation.transpose());
    turn += after.norm() / 58;
    jerk += (after - before).norm() / 58;
  }
  const double degree = std::numbers::pi / 180;
  EXPECT_GT(turn, 0.02 * degree);
  EXPECT_LT(turn, 0.5 * degree);
  EXPECT_LT(jerk, 0.4 * turn) << "band-limited: successive steps are alike";
  options.shake = 0;
  const SyntheticCamera calm = MakeSyntheticCamera(acting.vertices, 30, options);
  EXPECT_LT((calm.motion[0].translation - calm.motion[59].translation).norm(), 1e-9);
}

TEST_F(SyntheticPerformanceTest, ThreadsAndRunsGiveTheSameBytes) {
  PerformanceOptions options = Options(CameraMotion::kHandheld);
  options.scene.sensor_noise = 3;
  const std::vector<RenderedFrame> once = Render(MakePerformance(*character_, Walk(), options), 1);
  const std::vector<RenderedFrame> again = Render(MakePerformance(*character_, Walk(), options), 3);
  options.scene.seed = 2;
  const std::vector<RenderedFrame> other = Render(MakePerformance(*character_, Walk(), options), 1);
  ASSERT_EQ(once.size(), 8u);
  ASSERT_EQ(again.size(), 8u);
  for (size_t f = 0; f < once.size(); ++f) {
    EXPECT_EQ(once[f].index, static_cast<int>(f));
    EXPECT_EQ(cv::norm(once[f].bgr, again[f].bgr, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(once[f].mask, again[f].mask, cv::NORM_INF), 0);
  }
  EXPECT_GT(cv::norm(once[0].bgr, other[0].bgr, cv::NORM_INF), 30) << "another place";
}

TEST_F(SyntheticPerformanceTest, SensorNoiseHasTheSizeAskedFor) {
  PerformanceOptions options = Options(CameraMotion::kStatic);
  const std::vector<RenderedFrame> clean =
      Render(MakePerformance(*character_, StandStill(), options));
  options.scene.sensor_noise = 4;
  const std::vector<RenderedFrame> noisy =
      Render(MakePerformance(*character_, StandStill(), options));
  cv::Mat difference, mean, deviation;
  cv::subtract(noisy[0].bgr, clean[0].bgr, difference, cv::noArray(), CV_32F);
  // Where nothing saturates.
  cv::Mat channel, grey;
  cv::extractChannel(clean[0].bgr, grey, 1);
  cv::extractChannel(difference, channel, 1);
  cv::meanStdDev(channel, mean, deviation, (grey > 20) & (grey < 235));
  EXPECT_NEAR(mean.at<double>(0), 0, 0.1);
  EXPECT_NEAR(deviation.at<double>(0), 4, 0.15);
  EXPECT_GT(cv::norm(noisy[0].bgr, noisy[1].bgr, cv::NORM_INF), 5) << "another frame";
}

TEST_F(SyntheticPerformanceTest, FeetStandOnTheFloor) {
  const Acting acting = Walk();
  std::vector<float> lowest;
  for (const Eigen::Matrix3Xf& vertices : acting.vertices) {
    lowest.push_back(vertices.row(1).minCoeff());
  }
  std::sort(lowest.begin(), lowest.end());
  EXPECT_GT(lowest.front(), -0.03f);
  EXPECT_NEAR(lowest[1], 0, 1e-6);
  KinematicState state;
  ForwardKinematics(character_->skeleton, acting.poses.col(2), &state);
  Eigen::Matrix3Xf vertices;
  SkinCharacter(*character_, state, &vertices);
  EXPECT_LT((vertices - acting.vertices[2]).cwiseAbs().maxCoeff(), 1e-5f) << "poses moved too";
}

TEST_F(SyntheticPerformanceTest, MisuseIsRefused) {
  PerformanceOptions options = Options(CameraMotion::kStatic);
  options.scene.shutter = 2;
  options.scene.samples = 0;
  EXPECT_MPC_ERROR(MakePerformance(*character_, Walk(), options), kInvalidArgument, "samples is 0");
  options = Options(CameraMotion::kStatic);
  options.camera.width = 1;
  EXPECT_MPC_ERROR(MakePerformance(*character_, Walk(), options), kInvalidArgument, "width is 1");
  options = Options(CameraMotion::kStatic);
  Acting broken = Walk();
  broken.vertices[3](0, 0) = NAN;
  EXPECT_MPC_ERROR(MakePerformance(*character_, broken, options), kInvalidArgument, "not finite");
  broken.vertices.pop_back();
  EXPECT_MPC_ERROR(MakePerformance(*character_, broken, options), kInvalidArgument, "7 frames");
  EXPECT_MPC_ERROR(MakePerformance(*character_, Acting{}, options), kInvalidArgument,
                   "without frames");
  RigAsset textured = *rig_;
  textured.meshes[0].texture = {1, 2, 3};
  const SyntheticPerformance performance = MakePerformance(*character_, Walk(), options);
  EXPECT_MPC_ERROR(MakeScene(performance, textured, *character_), kBadFile, "PNG");
}

}  // namespace
}  // namespace mpc
