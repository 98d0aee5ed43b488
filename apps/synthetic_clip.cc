#include "synthetic_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <system_error>
#include <vector>

#include "console.h"
#include "mpc/core/error.h"
#include "mpc/eval/clothing.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/eval/motions.h"
#include "mpc/eval/retarget.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/bvh.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/gltf.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/pc2.h"
#include "mpc/io/rig_gltf.h"
#include "mpc/io/trc.h"
#include "mpc/io/truth_file.h"
#include "mpc/io/video.h"
#include "mpc/skeleton/proportions.h"
#include "mpc/skeleton/rig_map.h"

namespace monoperfcap {
namespace {

namespace fs = std::filesystem;

constexpr double kMinHeightM = 0.5;  // of a person; outside, a rig is in other units than metres
constexpr double kMaxHeightM = 2.5;
constexpr int kMaxFrames = 1000000;

mpc::Error Refused(mpc::ErrorCode code, const std::string& text) { return {code, text}; }

// The actor as the files of the clip will give it to whoever reads them.
struct Actor {
  mpc::DressedActor dressed;  // without cloth for a user's rig
  mpc::Character character;
};

// Writes actor.glb. `users` is the user's own rig, already read; without one the program's own actor
// is made.
Actor WriteActor(const SyntheticClipRequest& request, const std::optional<mpc::RigAsset>& users) {
  const fs::path path = request.output / "actor.glb";
  Actor actor;
  if (!users) {
    actor.dressed = mpc::MakeDressedActor({.outfit = request.outfit, .seed = request.options.seed});
    mpc::WriteRigGltf(path, actor.dressed.rig);
  } else if (request.actor.extension() == ".glb") {
    mpc::WriteFileAtomically(path, mpc::ReadFile(request.actor));
  } else {
    mpc::WriteRigGltf(path, *users);
  }
  actor.dressed.rig = mpc::ReadRigGltf(path);
  actor.character = mpc::BuildCharacter(actor.dressed.rig, mpc::MapRigByNames(actor.dressed.rig));
  const double height = mpc::ActorHeight(actor.character);
  if (height < kMinHeightM || height > kMaxHeightM) {
    throw Refused(mpc::ErrorCode::kUnsupported,
                  fmt::format("{}: the actor is {:.4g} m tall, expected {} to {} m",
                              request.actor.string(), height, kMinHeightM, kMaxHeightM));
  }
  return actor;
}

// Frames [begin, end) of a BVH file.
mpc::SourceMotion ReadBvhPart(const SyntheticClipRequest& request) {
  const mpc::BvhMotion bvh = mpc::ReadBvh(request.motion);
  const double first = std::round(request.start_s / bvh.frame_time_s);
  const double last = std::ceil((request.start_s + request.seconds) / bvh.frame_time_s);
  const int begin = static_cast<int>(std::min<double>(first, bvh.num_frames()));
  const int end =
      static_cast<int>(std::min<double>(last + 1, bvh.num_frames()));  // one more to interpolate
  if (end <= begin) {
    throw Refused(
        mpc::ErrorCode::kInvalidArgument,
        fmt::format("{} lasts {:.2f} s, the start at {} s lies behind its end", request.motion,
                    bvh.num_frames() * bvh.frame_time_s, request.start_s));
  }
  const mpc::BvhJointPaths paths = mpc::JointPathsOf(bvh, begin, end);
  return {paths.names, paths.parents, paths.positions, 1 / bvh.frame_time_s};
}

// `source` is the BVH file's motion, if it is one.
Eigen::MatrixXd MakePoses(const SyntheticClipRequest& request,
                          const std::optional<mpc::SourceMotion>& source,
                          const mpc::Skeleton& skeleton) {
  if (!source) {
    const auto kind = std::find_if(
        mpc::kAllMotions.begin(), mpc::kAllMotions.end(),
        [&](mpc::MotionKind motion) { return mpc::MotionName(motion) == request.motion; });
    return mpc::MakeMotion(skeleton, *kind, request.seconds, request.fps);
  }
  const Eigen::MatrixXd poses =
      mpc::ResamplePoses(mpc::Retarget(skeleton, *source), source->fps, request.fps);
  const auto wanted = static_cast<Eigen::Index>(std::lround(request.seconds * request.fps));
  return poses.leftCols(std::clamp<Eigen::Index>(wanted, 1, poses.cols()));
}

void WriteTruthFiles(const fs::path& folder, const mpc::SyntheticPerformance& performance) {
  const mpc::SyntheticCamera& camera = performance.camera;
  if (camera.motion.empty()) {
    mpc::WriteCameras(folder / "camera.json", {camera.camera});
  } else {
    mpc::WriteMovingCamera(folder / "camera.json", camera.camera, camera.motion);
  }
  if (performance.options.errors != mpc::DetectionErrors::kOff) {
    mpc::WriteDetections(folder / "detections2d.json", performance.detections.detections2d);
    mpc::WriteDetections(folder / "detections3d.json", performance.detections.detections3d);
  }
  mpc::MarkerTrajectories markers;
  for (int j = 0; j < mpc::kNumPaperJoints; ++j) {
    markers.names.emplace_back(mpc::JointName(static_cast<mpc::JointId>(j)));
  }
  markers.fps = performance.acting.fps;
  markers.positions = performance.joints;
  mpc::WriteTrc(folder / "truth.trc", markers);
  const std::vector<Eigen::Matrix3Xf>& vertices = performance.acting.vertices;
  mpc::Pc2Writer cache(folder / "vertices.pc2", static_cast<int>(vertices.front().cols()));
  for (const Eigen::Matrix3Xf& frame : vertices) cache.Write(frame);
  cache.Close();
}

bool WritePictures(const SyntheticClipRequest& request,
                   const mpc::SyntheticPerformance& performance, const mpc::SyntheticScene& scene,
                   const mpc::ProgressCallback& progress) {
  const mpc::SyntheticCameraOptions& camera = performance.options.camera;
  mpc::VideoWriter video(request.output / "clip.mp4", camera.width, camera.height, request.fps);
  mpc::MaskFolderWriter masks(request.output / "masks");
  const bool all = mpc::RenderPerformance(
      performance, scene, request.num_threads,
      [&](const mpc::RenderedFrame& frame) {
        video.Write(frame.bgr);
        masks.Write(frame.mask);
      },
      progress);
  if (!all) return false;
  video.Close();
  masks.Close();
  return true;
}

void WriteTruthJson(const SyntheticClipRequest& request,
                    const mpc::SyntheticPerformance& performance) {
  const mpc::PerformanceOptions& options = performance.options;
  mpc::TruthClip clip;
  clip.fps = request.fps;
  clip.num_frames = performance.num_frames();
  clip.width = options.camera.width;
  clip.height = options.camera.height;
  clip.motion = fs::path(request.motion).stem().string();
  if (request.actor.empty()) clip.outfit = mpc::OutfitName(request.outfit);
  clip.seed = options.seed;
  clip.camera_motion = mpc::CameraMotionName(options.camera.motion);
  clip.noise = mpc::DetectionErrorsName(options.errors);
  const fs::path& folder = request.output;
  clip.video = folder / "clip.mp4";
  clip.actor = folder / "actor.glb";
  clip.camera = folder / "camera.json";
  clip.joints = folder / "truth.trc";
  clip.vertices = folder / "vertices.pc2";
  clip.masks = folder / "masks";
  if (options.errors != mpc::DetectionErrors::kOff) {
    clip.detections2d = folder / "detections2d.json";
    clip.detections3d = folder / "detections3d.json";
  }
  mpc::WriteTruthClip(folder, clip);
}

// What an earlier clip left in the folder must not stand beside the new truth.
void RemoveOldClip(const fs::path& folder) {
  std::error_code ec;
  for (const char* name : {"truth.json", "clip.mp4", "detections2d.json", "detections3d.json"}) {
    fs::remove(folder / name, ec);
  }
}

// Before anything is read or removed.
void CheckNumbers(const SyntheticClipRequest& request) {
  request.options.Validate();
  if (!(request.seconds > 0 && request.start_s >= 0 && request.fps >= 1 && request.fps <= 1000) ||
      request.seconds * request.fps > kMaxFrames) {
    throw Refused(mpc::ErrorCode::kInvalidArgument,
                  fmt::format("{} s from {} s at {} frames per second are not 1 to {} frames",
                              request.seconds, request.start_s, request.fps, kMaxFrames));
  }
}

}  // namespace

bool IsBvhPath(const std::string& motion) {
  std::string extension = fs::path(motion).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".bvh";
}

bool WriteSyntheticClip(const SyntheticClipRequest& request, std::string* summary) {
  CheckNumbers(request);
  const bool is_bvh = IsBvhPath(request.motion);
  if (request.start_s > 0 && !is_bvh) {
    throw Refused(mpc::ErrorCode::kInvalidArgument, "--start is for BVH files only");
  }
  std::optional<mpc::SourceMotion> source;
  if (is_bvh) source = ReadBvhPart(request);
  std::optional<mpc::RigAsset> users;
  if (!request.actor.empty()) users = mpc::ReadRigGltf(request.actor);

  std::error_code ec;
  fs::create_directories(request.output, ec);
  if (!fs::is_directory(request.output, ec)) {
    throw Refused(
        mpc::ErrorCode::kWriteFailed,
        fmt::format("{} is not a folder and cannot be made one", request.output.string()));
  }
  RemoveOldClip(request.output);
  const Actor actor = WriteActor(request, users);
  mpc::Acting acting =
      mpc::ActWithSkinning(actor.character, MakePoses(request, source, actor.character.skeleton),
                           request.fps, request.num_threads);
  ConsoleProgress console(request.quiet);
  const auto progress = [&console](const mpc::Progress& step) { return console(step); };
  if (request.motion == mpc::MotionName(mpc::MotionKind::kSit)) {
    acting.stool = mpc::StoolUnder(actor.dressed, actor.character, acting.poses.col(0));
  }
  acting.vertices =
      mpc::Perform(actor.dressed, actor.character, acting.poses, request.fps, progress);
  const mpc::SyntheticPerformance performance =
      mpc::MakePerformance(actor.character, std::move(acting), request.options);
  const std::unique_ptr<mpc::SyntheticScene> scene =
      mpc::MakeScene(performance, actor.dressed.rig, actor.character);
  WriteTruthFiles(request.output, performance);
  if (!WritePictures(request, performance, *scene, progress)) return false;
  WriteTruthJson(request, performance);
  *summary = fmt::format("{}: {} frames of \"{}\" in a {}, truth.json names the files\n",
                         request.output.string(), performance.num_frames(), request.motion,
                         mpc::PlaceName(request.options.scene.place));
  return true;
}

}  // namespace monoperfcap
