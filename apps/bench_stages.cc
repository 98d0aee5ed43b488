#include "bench_stages.h"

#include <array>
#include <ctime>

#include "mpc/pose/calibration.h"
#include "mpc/pose/detection_rig.h"
#include "mpc/pose/frame_initializer.h"
#include "mpc/pose/pose_estimator.h"
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

// As EstimatePoses starts, proportions included.
StageOutput RunInitialization(const BenchClip& clip, const StageOutputs&) {
  const ProcessorWatch watch;
  const mpc::ClipEvidence evidence = Evidence(clip, {});
  const mpc::Proportions proportions =
      mpc::CalibrateProportions(evidence, mpc::InitializeFrames(evidence)).proportions;
  StageOutput output;
  output.character = Scaled(clip, proportions);
  output.poses = mpc::InitializeFrames(evidence.ForSkeleton(output.character.skeleton)).poses;
  output.seconds = watch.Seconds();
  return output;
}

StageOutput RunPose(const BenchClip& clip, const StageOutputs&) {
  const ProcessorWatch watch;
  const mpc::PoseTrack track =
      mpc::EstimatePoses(clip.character.skeleton, clip.camera, clip.detections2d,
                         &clip.detections3d, clip.fps, mpc::PoseOptions{});
  StageOutput output;
  output.seconds = watch.Seconds();
  output.poses = track.poses;
  output.character = Scaled(clip, track.proportions);
  return output;
}

constexpr std::array<Stage, 6> kStages = {{
    {"network", "network's 3D, rigged", RunNetworkRig},
    {"network_surface", "surface refinement on the network's 3D", nullptr},
    {"init", "E2d + E3d per frame", RunInitialization},
    {"pose", "E_pose", RunPose},
    {"refined_pose", "refined pose", nullptr},
    {"refined_surface", "refined surface", nullptr},
}};

}  // namespace

std::span<const Stage> Stages() { return kStages; }

}  // namespace monoperfcap
