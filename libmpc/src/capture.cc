#include "mpc/capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <exception>
#include <optional>
#include <system_error>

#include "actor.h"
#include "camera_turns.h"
#include "mask_outputs.h"
#include "model_fit.h"
#include "mpc/core/error.h"
#include "mpc/core/units.h"
#include "mpc/detect_clip.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/poses_file.h"
#include "mpc/io/video.h"
#include "mpc/io/video_lens.h"
#include "mpc/pose/focal_search.h"
#include "mpc/skeleton/proportions.h"
#include "outputs.h"
#include "overlay.h"
#include "report.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

constexpr const char* kGltfName = "performance.glb";
constexpr const char* kBvhName = "motion.bvh";
constexpr const char* kTrcName = "joints.trc";
// Of a focal length that the video's file states: cameras crop the picture to steady it.
constexpr double kStatedFocalSigma = 0.1;

Camera CameraForVideo(const CaptureInputs& inputs, const VideoReader& video,
                      std::vector<std::string>* warnings) {
  if (inputs.camera.empty()) {
    const double fov = inputs.fov_rad != 0 ? inputs.fov_rad : kUsualFovRad;  // until estimated
    return Camera::FromFov(video.width(), video.height(), fov);
  }
  Camera camera = ReadCamera(inputs.camera);
  if (camera.width == video.width() && camera.height == video.height()) return camera;
  Camera scaled = camera.ScaledTo(video.width(), video.height());
  warnings->push_back(fmt::format("camera {} is for {}x{} and was scaled to the video's {}x{}",
                                  camera.name, camera.width, camera.height, video.width(),
                                  video.height()));
  return scaled;
}

// Files do not always say for which picture they are: then most joints must lie inside the video's.
void CheckPictureSize(const Detections2d& detections, const CaptureInputs& inputs,
                      const VideoReader& video) {
  if (detections.width > 0 &&
      (detections.width != video.width() || detections.height != video.height())) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{} is for a picture of {}x{}, the video has {}x{}",
                            inputs.detections2d.string(), detections.width, detections.height,
                            video.width(), video.height()));
  }
  int num_seen = 0;
  int num_inside = 0;
  for (const Detections2d::Frame& frame : detections.frames) {
    for (Eigen::Index j = 0; j < frame.confidence.size(); ++j) {
      if (frame.confidence[j] <= 0) continue;
      const Eigen::Vector2d pixel = frame.pixels.col(j);
      ++num_seen;
      num_inside += pixel.x() >= 0 && pixel.x() < video.width() && pixel.y() >= 0 &&
                    pixel.y() < video.height();
    }
  }
  if (num_seen == 0) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{} sees no person in any frame", inputs.detections2d.string()));
  }
  if (2 * num_inside < num_seen) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{} has {} of {} joints outside of the video's picture of {}x{}: it "
                            "was made for another size",
                            inputs.detections2d.string(), num_seen - num_inside, num_seen,
                            video.width(), video.height()));
  }
}

void CheckFrameCount(const fs::path& file, size_t num_in_file, const fs::path& other,
                     int num_frames) {
  if (num_in_file == static_cast<size_t>(num_frames)) return;
  throw Error(ErrorCode::kMismatch, fmt::format("{} has {} frames, but {} has {}", file.string(),
                                                num_in_file, other.string(), num_frames));
}

// What the first reading of the video tells.
struct FirstReading {
  int num_frames = 0;               // their true number
  std::vector<cv::Mat> background;  // of BackgroundFrames; none if the file says another number
};

// Decodes all frames, so that a broken or variable-rate video is found before any long work.
FirstReading ReadVideo(const CaptureInputs& inputs, bool keep_background,
                       const ProgressCallback& progress) {
  VideoReader video(inputs.video, inputs.image_fps);
  std::vector<int> wanted;
  if (keep_background) wanted = BackgroundFrames(video.num_frames());
  FirstReading reading;
  for (;;) {
    const size_t num_kept = reading.background.size();
    const bool keep = num_kept < wanted.size() && wanted[num_kept] == reading.num_frames;
    cv::Mat picture;
    if (!(keep ? video.Read(&picture) : video.Skip())) break;
    if (keep) reading.background.push_back(picture);
    ++reading.num_frames;
    const int expected = std::max(video.num_frames(), reading.num_frames);
    if (progress && !progress({"video", reading.num_frames, expected})) {
      throw Error(ErrorCode::kCancelled, "stopped while the video was read: nothing was written");
    }
  }
  if (reading.num_frames != video.num_frames()) reading.background.clear();
  return reading;
}

// What is known of the focal length without looking at the pictures.
FocalPrior PriorOfFocal(const CaptureInputs& inputs, CaptureReport* report) {
  const Camera& camera = report->camera;
  const std::optional<double> focal_35mm = ReadFocalLength35mm(inputs.video);
  if (!focal_35mm) return FocalPrior::Usual(camera.width, camera.height);
  report->focal_35mm = *focal_35mm;
  return {.focal_px = FocalPxFrom35mm(*focal_35mm, camera.width, camera.height),
          .relative_sigma = kStatedFocalSigma};
}

// Of all threads of the process.
double ProcessorSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// Things a user should look at.
void AddTrackWarnings(const PoseTrack& track, std::vector<std::string>* warnings) {
  int num_interpolated = 0;
  int num_rejected = 0;
  int num_swapped = 0;
  for (const FrameReport& frame : track.frames) {
    num_interpolated += frame.state == TrackState::kInterpolated ? 1 : 0;
    num_rejected += frame.state == TrackState::kRejected ? 1 : 0;
    num_swapped += frame.swapped_sides ? 1 : 0;
  }
  const size_t num_frames = track.frames.size();
  const auto add = [&](int count, const char* what) {
    if (count > 0) warnings->push_back(fmt::format("{} of {} frames {}", count, num_frames, what));
  };
  add(num_interpolated, "show nobody and were interpolated");
  add(num_rejected, "have detections that disagree with the pose");
  add(num_swapped, "had left and right of the detections exchanged");
}

// The turns of a camera whose places are not known; none when it rests or they cannot be told.
std::vector<CameraFromWorld> FindCameraTurns(const CaptureInputs& inputs,
                                             std::span<const cv::Mat> background,
                                             const Detections2d& detections,
                                             const ProgressCallback& progress,
                                             CaptureReport* report) {
  const std::vector<int> frames = BackgroundFrames(report->num_frames);
  if (internal::CameraRests(background, frames, detections)) return {};
  std::optional<internal::TurningCamera> turning = internal::FollowCamera(
      VideoReader(inputs.video, inputs.image_fps), report->camera, detections, progress);
  if (!turning) {
    throw Error(ErrorCode::kCancelled, "stopped while the camera's turns were looked for");
  }
  if (2 * turning->num_unseen > report->num_frames) return {};
  report->warnings.push_back(fmt::format(
      "the camera moves and where it is was not given (\"frames\" of the camera file): "
      "its turns, up to {:.0f} degrees, were estimated from the background of {} of {} frames",
      turning->largest_rad / kDegree, report->num_frames - turning->num_unseen,
      report->num_frames));
  return std::move(turning->places);
}

// Results of a camera that moves unnoticed are right in its own frame only.
void AddCameraMotionWarning(CaptureReport* report) {
  const auto num_moving =
      std::count_if(report->refinement.begin(), report->refinement.end(),
                    [](const RefinementRecord& r) { return r.silhouette.camera_motion; });
  if (num_moving * 10 < report->num_frames) return;
  report->warnings.push_back(fmt::format(
      "the camera moves in {} of {} frames and where it is was not given (\"frames\" of the camera "
      "file): the world is that of a camera at rest, so the person seems to move with it",
      num_moving, report->num_frames));
}

}  // namespace

void CaptureOptions::Validate() const {
  pose.Validate();
  refinement.Validate();
  detect.Validate();
  if (!(height_m >= 0 && height_m < 1000)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("height_m is {}, expected 0 or a height in metres", height_m));
  }
}

struct Capture::Inputs {
  internal::Actor actor;
  std::vector<CameraFromWorld> camera_motion;  // empty: the camera stands, or nobody knows
  Detections2d detections2d;
  std::optional<Detections3d> detections3d;
  CaptureReport report;  // with all that is known before the work starts

  Inputs(const CaptureInputs& inputs, const CaptureOptions& options);
};

Capture::Inputs::Inputs(const CaptureInputs& inputs, const CaptureOptions& options) {
  actor = internal::LoadActor(inputs.actor, options.height_m);
  report.mapping = actor.mapping;
  for (const RigBone& bone : actor.rig.bones) report.rig_bones.push_back(bone.name);
  report.height_scale = actor.height_scale;
  report.warnings = actor.warnings;

  const VideoReader video(inputs.video, inputs.image_fps);
  report.fps = video.fps();
  report.camera = CameraForVideo(inputs, video, &report.warnings);
  if (!inputs.camera.empty()) camera_motion = ReadCameraMotion(inputs.camera);
  if (!camera_motion.empty()) {
    report.camera.camera_from_world = camera_motion.front();
    report.camera.has_extrinsics = true;
  }
  int num_frames = -1;  // not known before the video is read
  if (inputs.detections2d.empty()) {
    if (!inputs.detections3d.empty()) {
      throw Error(ErrorCode::kInvalidArgument, "3D detections need 2D detections beside them");
    }
    static_cast<void>(FindPoseModels(inputs.models));
  } else {
    detections2d = ReadDetections2d(inputs.detections2d);
    CheckPictureSize(detections2d, inputs, video);
    num_frames = static_cast<int>(detections2d.frames.size());
  }
  const auto check = [&](const fs::path& path, size_t count) {
    if (num_frames >= 0) CheckFrameCount(path, count, inputs.detections2d, num_frames);
  };
  if (!camera_motion.empty()) check(inputs.camera, camera_motion.size());
  if (!inputs.detections3d.empty()) {
    detections3d = ReadDetections3d(inputs.detections3d);
    check(inputs.detections3d, detections3d->frames.size());
  }
  for (const fs::path& masks : {inputs.masks, inputs.true_masks}) {
    if (masks.empty()) continue;
    const MaskReader reader(masks, video.width(), video.height());
    if (reader.num_frames() >= 0) check(masks, static_cast<size_t>(reader.num_frames()));
  }
}

Capture::Capture(CaptureInputs inputs, fs::path output, CaptureOptions options)
    : inputs_(std::move(inputs)), output_(std::move(output)), options_(std::move(options)) {
  options_.Validate();
  loaded_ = std::make_unique<Inputs>(inputs_, options_);
  const std::array inputs_to_keep = {inputs_.video,        inputs_.actor, inputs_.detections2d,
                                     inputs_.detections3d, inputs_.masks, inputs_.true_masks};
  internal::PrepareOutput(
      output_, inputs_to_keep,
      std::array{kDetections2dName, kDetections3dName, kGltfName, kBvhName, kTrcName,
                 internal::kPosesName, internal::kMasksName, internal::kSurfaceName,
                 internal::kOverlayName, internal::kReportName});
}

Capture::~Capture() = default;

// Of the morph targets.
int Capture::FramesPerTarget() const {
  constexpr double kTargetsPerSecond = 10;
  if (options_.surface == SurfaceTargets::kFull) return 1;
  return std::max(1, static_cast<int>(std::lround(loaded_->report.fps / kTargetsPerSecond)));
}

CaptureReport Capture::Run(const ProgressCallback& progress) {
  CaptureReport report = loaded_->report;
  // The stages change these; the loaded inputs stay as they are for another run.
  RigAsset rig = loaded_->actor.rig;
  Character character = loaded_->actor.character;
  Detections2d detections2d = loaded_->detections2d;
  std::optional<Detections3d> detections3d = loaded_->detections3d;
  std::vector<PersonMask> person_masks;
  int person_gap = 1;
  const int num_threads = options_.pose.num_threads;
  const auto timed = [&report](const char* stage, const auto& work) {
    const auto start = std::chrono::steady_clock::now();
    const double core_start = ProcessorSeconds();
    work();
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    const double core_elapsed = ProcessorSeconds() - core_start;
    for (StageSeconds& timing : report.timings) {
      if (timing.stage == stage) {
        timing.seconds += elapsed.count();
        timing.core_seconds += core_elapsed;
        return;
      }
    }
    report.timings.push_back({stage, elapsed.count(), core_elapsed});
  };

  std::vector<CameraFromWorld> camera_motion = loaded_->camera_motion;
  const bool find_turns = options_.camera_turns && !report.camera.has_extrinsics;
  std::vector<cv::Mat> background;
  timed("video", [&] {
    const bool make_plate = options_.masks && inputs_.masks.empty() &&
                            options_.refinement.silhouettes.segmentation.weight_plate > 0;
    FirstReading reading = ReadVideo(inputs_, make_plate || find_turns, progress);
    report.num_frames = reading.num_frames;
    background = std::move(reading.background);
    const auto check = [&](const fs::path& path, size_t count) {
      if (!path.empty()) CheckFrameCount(path, count, inputs_.video, report.num_frames);
    };
    check(inputs_.detections2d, detections2d.frames.size());
    if (!camera_motion.empty()) check(inputs_.camera, camera_motion.size());
  });
  if (inputs_.detections2d.empty()) {
    timed("detect", [&] {
      ClipDetections detected = DetectClip(
          {.video = inputs_.video, .image_fps = inputs_.image_fps, .models = inputs_.models},
          options_.detect, progress);
      for (const std::string& warning : DetectionWarnings(detected)) {
        report.warnings.push_back(warning);
      }
      WriteDetections(output_ / kDetections2dName, detected.detections2d);
      report.outputs.emplace_back(kDetections2dName);
      WriteDetections(output_ / kDetections3dName, detected.detections3d);
      report.outputs.emplace_back(kDetections3dName);
      detections2d = std::move(detected.detections2d);
      detections3d = std::move(detected.detections3d);
      person_masks = std::move(detected.masks);
      person_gap = detected.every;
    });
  }
  if (inputs_.camera.empty() && inputs_.fov_rad == 0) {
    timed("focal", [&] {
      const FocalEstimate focal =
          EstimateFocal(character.skeleton, report.camera.width, report.camera.height, detections2d,
                        detections3d ? &*detections3d : nullptr, report.fps, options_.pose,
                        PriorOfFocal(inputs_, &report), progress);
      report.camera.fx = report.camera.fy = focal.focal_px;
      report.focal_uncertainty = focal.relative_sigma;
      report.warnings.push_back(
          fmt::format("the focal length was estimated: {:.0f} px, give or take {:.0f} % (give "
                      "--camera or --fov if it is known)",
                      focal.focal_px, 100 * focal.relative_sigma));
    });
  }
  if (find_turns) {
    timed("camera", [&] {
      camera_motion = FindCameraTurns(inputs_, background, detections2d, progress, &report);
    });
  }
  timed("pose", [&] {
    report.track = EstimatePoses(character.skeleton, report.camera, detections2d,
                                 detections3d ? &*detections3d : nullptr, report.fps, options_.pose,
                                 camera_motion, progress);
    ApplyProportions(report.track.proportions, &character, &rig);
    report.skeleton = character.skeleton;
  });
  report.complete = !report.track.cancelled;
  if (!person_masks.empty()) {
    timed("fit", [&] {
      report.person_iou = internal::ModelFit(character, report.camera, report.track.poses,
                                             person_masks, num_threads);
    });
    internal::AddModelFitWarning(report.person_iou, &report.warnings);
  }
  AddTrackWarnings(report.track, &report.warnings);
  timed("world", [&] {
    report.world =
        PlaceInWorld(character, report.track.poses, report.camera, camera_motion, num_threads);
  });
  for (const std::string& warning : report.world.warnings) report.warnings.push_back(warning);

  // A report of an earlier run must not vouch for the files of this one.
  std::error_code ec;
  for (const char* name : {internal::kReportName, internal::kMasksName, internal::kSurfaceName,
                           internal::kOverlayName}) {
    fs::remove(output_ / name, ec);
  }
  const internal::Performance performance = {
      rig, character, report.camera, report.track.poses, report.world, report.fps};
  // surface: a surface.pc2 for the morph targets of the glTF; empty: none.
  const auto write_motion = [&](const fs::path& surface) {
    report.surface = internal::WritePerformanceGltf(output_ / kGltfName, inputs_.actor, performance,
                                                    surface, FramesPerTarget());
    internal::WriteMotionBvh(output_ / kBvhName, performance);
    internal::WriteJointsTrc(output_ / kTrcName, performance);
    WritePoses(output_ / internal::kPosesName, {.video = fs::absolute(inputs_.video),
                                                .image_fps = inputs_.image_fps,
                                                .actor = fs::absolute(inputs_.actor),
                                                .height_m = options_.height_m,
                                                .proportions = report.track.proportions,
                                                .fps = report.fps,
                                                .camera = report.camera,
                                                .dofs = internal::DofNames(character.skeleton),
                                                .poses = report.track.poses});
  };
  // Before the refinement: whatever ends that, the motion is there.
  timed("files", [&] { write_motion({}); });
  for (const char* name : {kGltfName, kBvhName, kTrcName, internal::kPosesName}) {
    report.outputs.emplace_back(name);
  }
  bool has_surface = false;
  std::exception_ptr overlay_error;
  if (options_.masks && report.complete) {
    timed("refinement", [&] {
      PosedClip clip = {.video = inputs_.video,
                        .image_fps = inputs_.image_fps,
                        .camera = report.camera,
                        .character = character,
                        .poses = report.track.poses,
                        .masks = inputs_.masks,
                        .true_masks = inputs_.true_masks,
                        .error_2d_mm = report.track.error_2d_mm,
                        .camera_motion = camera_motion,
                        .background = &background};
      if (options_.person_masks) {
        clip.person_masks = person_masks;
        clip.person_gap = person_gap;
      }
      ClipRefinementOptions options = options_.refinement;
      options.silhouettes.num_threads = num_threads;
      auto [refinement, error] =
          internal::WriteRefinement(output_, report.world, report.fps, clip, options,
                                    options_.overlay ? &detections2d : nullptr, progress);
      overlay_error = error;
      report.refinement = std::move(refinement.frames);
      report.complete = report.refinement.size() == static_cast<size_t>(report.num_frames);
      if (!report.complete) return;
      report.track.poses = std::move(refinement.poses);
      report.outputs.push_back(internal::kMasksName);
      has_surface = options.frames.level == RefinementLevel::kSurface;
      if (has_surface) report.outputs.push_back(internal::kSurfaceName);
      if (options_.overlay) report.outputs.push_back(internal::kOverlayName);
    });
    if (report.complete && options_.refinement.frames.level != RefinementLevel::kNone) {
      const bool targets = has_surface && options_.surface != SurfaceTargets::kNone;
      timed("files",
            [&] { write_motion(targets ? output_ / internal::kSurfaceName : fs::path()); });
    }
    internal::AddRefinementWarnings(report.refinement, &report.warnings);
    if (camera_motion.empty()) AddCameraMotionWarning(&report);
  }
  if (overlay_error) std::rethrow_exception(overlay_error);
  // With silhouettes it was drawn while they were found.
  if (options_.overlay && !options_.masks && report.complete) {
    timed("overlay", [&] {
      report.complete = internal::WriteOverlay(
          output_ / internal::kOverlayName, VideoReader(inputs_.video, inputs_.image_fps),
          {character, report.camera, detections2d}, report.track.poses, num_threads, progress);
      if (report.complete) report.outputs.push_back(internal::kOverlayName);
    });
  }
  report.outputs.push_back(internal::kReportName);
  internal::WriteReport(output_ / internal::kReportName, inputs_, options_, report);
  return report;
}

}  // namespace mpc
