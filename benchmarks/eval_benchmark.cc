// Speed of synthetic clips: a 720p picture of a walking actor in a room with a handheld camera, and the
// actor with its clothes, on one core. The picture's baseline does far less: the actor alone, once per
// pixel, with neither place nor light (ShadeMesh).
#include <benchmark/benchmark.h>

#include "mpc/eval/clothing.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/eval/motions.h"
#include "mpc/eval/synthetic_performance.h"
#include "mpc/render/lit_scene.h"
#include "mpc/render/shade.h"
#include "mpc/skeleton/rig_map.h"

namespace {

struct Clip {
  mpc::RigAsset rig = mpc::MakeDressedActor().rig;
  mpc::Character character = mpc::BuildCharacter(rig, mpc::MapRigByNames(rig));
  mpc::SyntheticPerformance performance;

  explicit Clip(int samples, mpc::CameraMotion motion = mpc::CameraMotion::kHandheld) {
    mpc::PerformanceOptions options;
    options.camera.width = 1280;
    options.camera.height = 720;
    options.camera.motion = motion;
    options.scene.samples = samples;
    const Eigen::MatrixXd poses =
        mpc::MakeMotion(character.skeleton, mpc::MotionKind::kWalk, 0.1, 30);
    performance = mpc::MakePerformance(
        character, mpc::ActWithSkinning(character, poses, 30, /*num_threads=*/1), options);
  }
  mpc::SceneMoment Moment(int frame) const {
    return {performance.acting.vertices[static_cast<size_t>(frame)], performance.camera.At(frame)};
  }
};

void Picture720p(benchmark::State& state, mpc::CameraMotion motion) {
  const Clip clip(static_cast<int>(state.range(0)), motion);
  const auto scene = mpc::MakeScene(clip.performance, clip.rig, clip.character);
  for (auto _ : state) {
    benchmark::DoNotOptimize(scene->Picture(clip.performance.camera.camera, clip.Moment(0),
                                            clip.Moment(1), clip.Moment(2), 1, 30));
  }
}
void Picture720p_Handheld(benchmark::State& state) {
  Picture720p(state, mpc::CameraMotion::kHandheld);
}
BENCHMARK(Picture720p_Handheld)->ArgName("samples")->Arg(1)->Arg(4)->Unit(benchmark::kMillisecond);

void Picture720p_AtRest(benchmark::State& state) { Picture720p(state, mpc::CameraMotion::kStatic); }
BENCHMARK(Picture720p_AtRest)->ArgName("samples")->Arg(4)->Unit(benchmark::kMillisecond);

void Mask720p(benchmark::State& state) {
  const Clip clip(1);
  const auto scene = mpc::MakeScene(clip.performance, clip.rig, clip.character);
  for (auto _ : state) {
    benchmark::DoNotOptimize(scene->Mask(clip.performance.camera.camera, clip.Moment(1)));
  }
}
BENCHMARK(Mask720p)->Unit(benchmark::kMillisecond);

void Picture720p_AtRest_BaselineActorUnlit(benchmark::State& state) {
  const Clip clip(1);
  const Eigen::Matrix3Xf x =
      mpc::ToCamera(clip.Moment(1).camera_from_world, clip.Moment(1).vertices);
  cv::Mat picture = cv::Mat::zeros(720, 1280, CV_8UC3);
  for (auto _ : state) {
    mpc::ShadeMesh(clip.performance.camera.camera, x, clip.character.mesh.triangles, {}, 1,
                   &picture);
    benchmark::DoNotOptimize(picture.data);
  }
}
BENCHMARK(Picture720p_AtRest_BaselineActorUnlit)
    ->ArgName("samples")
    ->Arg(4)
    ->Unit(benchmark::kMillisecond);

}  // namespace

namespace mpc {
namespace {

void MakeActor(benchmark::State& state, Outfit outfit) {
  for (auto _ : state) benchmark::DoNotOptimize(MakeDressedActor({.outfit = outfit}));
}

void MakeDressedActor_Skirt(benchmark::State& state) { MakeActor(state, Outfit::kSkirt); }
BENCHMARK(MakeDressedActor_Skirt)->Unit(benchmark::kMillisecond);

void MakeDressedActor_Skirt_BaselineNoCloth(benchmark::State& state) {
  MakeActor(state, Outfit::kTight);
}
BENCHMARK(MakeDressedActor_Skirt_BaselineNoCloth)->Unit(benchmark::kMillisecond);

struct Performer {
  explicit Performer(Outfit outfit)
      : actor(MakeDressedActor({.outfit = outfit})),
        character(BuildCharacter(actor.rig, MapRigByNames(actor.rig))) {}
  DressedActor actor;
  Character character;
};

// Two seconds of walking at 30 fps, and before them the time in which the cloth is put on.
void PerformTwoSeconds(benchmark::State& state, Outfit outfit) {
  const Performer performer(outfit);
  const Eigen::MatrixXd poses = MakeMotion(performer.character.skeleton, MotionKind::kWalk, 2, 30);
  for (auto _ : state) {
    benchmark::DoNotOptimize(Perform(performer.actor, performer.character, poses, 30));
  }
}

void Perform_Skirt60Frames(benchmark::State& state) { PerformTwoSeconds(state, Outfit::kSkirt); }
BENCHMARK(Perform_Skirt60Frames)->Unit(benchmark::kMillisecond);

void Perform_Skirt60Frames_BaselineSkinning(benchmark::State& state) {
  PerformTwoSeconds(state, Outfit::kTight);
}
BENCHMARK(Perform_Skirt60Frames_BaselineSkinning)->Unit(benchmark::kMillisecond);

void Perform_Casual60Frames(benchmark::State& state) { PerformTwoSeconds(state, Outfit::kCasual); }
BENCHMARK(Perform_Casual60Frames)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mpc
