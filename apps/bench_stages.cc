#include "bench_stages.h"

#include <array>
#include <ctime>
#include <memory>
#include <vector>

#include "console.h"
#include "mpc/pose/detection_rig.h"
#include "mpc/pose/frame_initializer.h"
#include "mpc/pose/pose_estimator.h"
#include "mpc/refinement.h"
#include "mpc/skeleton/proportions.h"

namespace monoperfcap {
namespace {

// Processor time does not depend on what else the machine does.
class ProcessorWatch {
 public:
  double Seconds() const { return static_cast<double>(std::clock() - start_) / CLOCKS_PER_SEC; }

 private:
  std::clock_t start_ = std::clock();
};

mpc::ClipEvidence Evidence(const BenchClip& clip, const mpc::PoseOptions& options) {
  return {clip.character.skeleton, clip.camera, clip.detections2d,
          &clip.detections3d,      clip.fps,    options};
}

mpc::Character Scaled(const BenchClip& clip, const mpc::Proportions& proportions) {
  mpc::Character character = clip.character;
  mpc::RigAsset rig = clip.rig;
  mpc::ApplyProportions(proportions, &character, &rig);
  return character;
}

StageOutput RunNetworkRig(const BenchClip& clip, const StageOutputs&) {
  const ProcessorWatch watch;
  mpc::PoseOptions options = mpc::PoseOptions::Paper();
  options.weight_rest = 0.01;  // for the twists that no joint shows
  StageOutput output;
  output.poses = mpc::RigDetections(Evidence(clip, options));
  output.seconds = watch.Seconds();
  output.character = clip.character;
  return output;
}

// As EstimatePoses starts.
StageOutput RunInitialization(const BenchClip& clip, const StageOutputs&) {
  const ProcessorWatch watch;
  const mpc::ClipEvidence evidence = Evidence(clip, {});
  StageOutput output;
  output.character = clip.character;
  output.poses = mpc::InitializeFrames(evidence).poses;
  output.seconds = watch.Seconds();
  return output;
}

StageOutput RunPose(const BenchClip& clip, const StageOutputs&) {
  const ProcessorWatch watch;
  const mpc::PoseTrack track =
      mpc::EstimatePoses(clip.character.skeleton, clip.camera, clip.detections2d,
                         &clip.detections3d, clip.fps, mpc::PoseOptions{}, clip.truth.motion);
  StageOutput output;
  output.seconds = watch.Seconds();
  output.poses = track.poses;
  output.error_2d_mm = track.error_2d_mm;
  output.character = Scaled(clip, track.proportions);
  return output;
}

// Silhouettes and what follows from them, of the poses of the stage before.
StageOutput Refine(const BenchClip& clip, const StageOutput& before, mpc::RefinementLevel level) {
  const ProcessorWatch watch;
  mpc::ClipRefinementOptions options;
  options.frames.level = level;
  const mpc::PosedClip posed = {.video = clip.video,
                                .camera = clip.camera,
                                .character = before.character,
                                .poses = before.poses,
                                .error_2d_mm = before.error_2d_mm,
                                .camera_motion = clip.truth.motion};
  const auto surface = std::make_shared<std::vector<Eigen::Matrix3Xf>>();
  const mpc::ClipRefinement refinement = mpc::RefineClip(
      posed, options, [&](const mpc::RefinedFrame& frame) { surface->push_back(frame.vertices); },
      [](const mpc::Progress&) { return !Interrupted(); });
  StageOutput output;
  output.poses = refinement.poses;
  output.character = before.character;
  output.surface = surface;
  output.surface_seconds = refinement.surface_s;
  output.seconds = before.seconds + watch.Seconds() - refinement.surface_s;
  return output;
}

StageOutput WithSurface(StageOutput output) {
  output.vertices = [surface = output.surface](int frame, Eigen::Matrix3Xf* vertices) {
    *vertices = (*surface)[static_cast<size_t>(frame)];
  };
  output.seconds += output.surface_seconds;
  return output;
}

StageOutput RunNetworkSurface(const BenchClip& clip, const StageOutputs& before) {
  return WithSurface(Refine(clip, before.at("network"), mpc::RefinementLevel::kSurfaceOnly));
}
StageOutput RunRefinedPose(const BenchClip& clip, const StageOutputs& before) {
  return Refine(clip, before.at("pose"), mpc::RefinementLevel::kSurface);
}
StageOutput RunRefinedSurface(const BenchClip&, const StageOutputs& before) {
  return WithSurface(before.at("refined_pose"));
}

constexpr std::array<Stage, 6> kStages = {{
    {"network", "network's 3D, rigged", "", RunNetworkRig},
    {"network_surface", "surface refinement on the network's 3D", "", RunNetworkSurface},
    {"init", "E2d + E3d per frame", "", RunInitialization},
    {"pose", "E_pose", "init", RunPose},
    {"refined_pose", "refined pose", "pose", RunRefinedPose},
    {"refined_surface", "refined surface", "refined_pose", RunRefinedSurface},
}};

}  // namespace

std::span<const Stage> Stages() { return kStages; }

}  // namespace monoperfcap
