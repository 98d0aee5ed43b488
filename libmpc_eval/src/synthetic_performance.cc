#include "mpc/eval/synthetic_performance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/eval/motions.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace mpc {
namespace {

constexpr double kSunkFraction = 0.2;  // of the frames may have a foot below the floor

DetectionNoise NoiseOf(DetectionErrors errors) {
  if (errors == DetectionErrors::kWhite) return DetectionNoise::White(5, 60, 0.1, 0.2);
  if (errors == DetectionErrors::kMeasured) return DetectionNoise::MeasuredWithFailures();
  return {};
}

SceneMoment MomentAt(const SyntheticPerformance& performance, int frame) {
  const int f = std::clamp(frame, 0, performance.num_frames() - 1);
  return {performance.acting.vertices[static_cast<size_t>(f)], performance.camera.At(f)};
}

void CheckActing(const Character& character, const Acting& acting) {
  const auto fail = [](const std::string& text) { throw Error(ErrorCode::kInvalidArgument, text); };
  if (acting.vertices.empty()) fail("a performance without frames");
  if (acting.poses.rows() != character.skeleton.num_dofs() ||
      acting.poses.cols() != static_cast<Eigen::Index>(acting.vertices.size())) {
    fail(fmt::format("poses of {} x {} for {} dofs and {} frames", acting.poses.rows(),
                     acting.poses.cols(), character.skeleton.num_dofs(), acting.vertices.size()));
  }
  for (const Eigen::Matrix3Xf& vertices : acting.vertices) {
    if (vertices.cols() != character.mesh.positions.cols() || !vertices.allFinite()) {
      fail(fmt::format("{} vertices in a frame of a character with {}, or one that is not finite",
                       vertices.cols(), character.mesh.positions.cols()));
    }
  }
}

}  // namespace

std::string_view DetectionErrorsName(DetectionErrors errors) {
  switch (errors) {
    case DetectionErrors::kOff:
      return "off";
    case DetectionErrors::kExact:
      return "exact";
    case DetectionErrors::kWhite:
      return "white";
    case DetectionErrors::kMeasured:
      return "measured";
  }
  return "";
}

void PerformanceOptions::Validate() const {
  camera.Validate();
  scene.Validate();
}

Acting ActWithSkinning(const Character& character, const Eigen::MatrixXd& poses, double fps,
                       int num_threads) {
  Acting acting;
  acting.fps = fps;
  acting.poses = poses;
  acting.vertices.resize(static_cast<size_t>(poses.cols()));
  if (poses.cols() == 0) return acting;
  std::vector<double> lowest(acting.vertices.size());
  ParallelFor(static_cast<int>(poses.cols()), num_threads, [&](int f) {
    KinematicState state;
    ForwardKinematics(character.skeleton, poses.col(f), &state);
    Eigen::Matrix3Xf& vertices = acting.vertices[static_cast<size_t>(f)];
    SkinCharacter(character, state, &vertices);
    lowest[static_cast<size_t>(f)] = vertices.row(1).minCoeff();
  });
  std::sort(lowest.begin(), lowest.end());
  const double floor =
      lowest[static_cast<size_t>(kSunkFraction * static_cast<double>(lowest.size() - 1))];
  acting.poses.row(1).array() -= floor;
  for (Eigen::Matrix3Xf& vertices : acting.vertices) {
    vertices.row(1).array() -= static_cast<float>(floor);
  }
  return acting;
}

SyntheticPerformance MakePerformance(const Character& character, Acting acting,
                                     const PerformanceOptions& options) {
  options.Validate();
  CheckActing(character, acting);
  SyntheticPerformance performance;
  performance.options = options;
  performance.camera = MakeSyntheticCamera(acting.vertices, acting.fps, options.camera);
  performance.joints =
      JointTrajectories(character.skeleton, acting.poses).topRows(3 * kNumPaperJoints);
  if (options.errors != DetectionErrors::kOff) {
    Eigen::MatrixXd in_camera(acting.poses.rows(), acting.poses.cols());
    for (int f = 0; f < in_camera.cols(); ++f) {
      const CameraFromWorld& pose = performance.camera.At(f);
      in_camera.col(f) = TransformPoses(pose.rotation, pose.translation, acting.poses.col(f));
    }
    performance.detections =
        SynthesizeDetections(character.skeleton, in_camera, performance.camera.camera, acting.fps,
                             NoiseOf(options.errors), options.seed);
  }
  performance.acting = std::move(acting);
  return performance;
}

std::unique_ptr<SyntheticScene> MakeScene(const SyntheticPerformance& performance,
                                          const RigAsset& rig, const Character& character) {
  StageBounds stage;
  for (int f = 0; f < performance.num_frames(); ++f) {
    const Eigen::Matrix3Xf& vertices = performance.acting.vertices[static_cast<size_t>(f)];
    stage.actor.extend(vertices.rowwise().minCoeff().cast<double>());
    stage.actor.extend(vertices.rowwise().maxCoeff().cast<double>());
    stage.camera.extend(performance.camera.At(f).Inverse().translation);
  }
  stage.stool = performance.acting.stool;
  const Camera& camera = performance.camera.camera;
  stage.half_fov_rad = std::atan(0.5 * camera.width / camera.fx);
  return std::make_unique<SyntheticScene>(performance.options.scene, stage, rig, character,
                                          performance.camera.motion.empty() ? &camera : nullptr);
}

bool RenderPerformance(const SyntheticPerformance& performance, const SyntheticScene& scene,
                       int num_threads, const std::function<void(const RenderedFrame&)>& sink,
                       const ProgressCallback& progress) {
  const int num_frames = performance.num_frames();
  const Camera& camera = performance.camera.camera;
  std::vector<RenderedFrame> frames(static_cast<size_t>(2 * ResolveNumThreads(num_threads)));
  if (progress && !progress({"clip", 0, num_frames})) return false;
  for (int begin = 0; begin < num_frames;) {
    const int count = std::min(static_cast<int>(frames.size()), num_frames - begin);
    ParallelFor(count, num_threads, [&](int i) {
      const int f = begin + i;
      const SceneMoment moment = MomentAt(performance, f);
      RenderedFrame& frame = frames[static_cast<size_t>(i)];
      frame.index = f;
      frame.bgr = scene.Picture(camera, MomentAt(performance, f - 1), moment,
                                MomentAt(performance, f + 1), f, performance.acting.fps);
      frame.mask = scene.Mask(camera, moment);
    });
    for (int i = 0; i < count; ++i) sink(frames[static_cast<size_t>(i)]);
    begin += count;
    if (progress && !progress({"clip", begin, num_frames})) return false;
  }
  return true;
}

}  // namespace mpc
