// Purpose: the whole capability in one call: a video and a rigged actor in, a folder with the
// actor's performance out. Joins the libraries; computes nothing itself.
// Frames: poses in the camera frame; files as docs/conventions.md says. Units: metres, seconds.
// Symbols: N dofs, F frames of the video.
#pragma once

#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/progress.h"
#include "mpc/detect/clip_detector.h"
#include "mpc/io/gltf.h"
#include "mpc/pose/pose_estimator.h"
#include "mpc/refinement.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_map.h"
#include "mpc/skeleton/world.h"

namespace mpc {

struct CaptureInputs {
  std::filesystem::path video;
  std::filesystem::path actor;              // .glb or .gltf with a skinned humanoid
  std::string camera;                       // "file.json" or "file.json:name"; empty: fov_rad
  double fov_rad = 0;                       // of the picture's longer side, in (0, pi)
  double image_fps = 0;                     // frame rate when `video` is a folder of pictures
  std::filesystem::path detections2d = {};  // as many frames as the video; empty: the networks
  std::filesystem::path detections3d = {};  // the same; empty, with detections2d: 2D only
  std::filesystem::path models = {};        // folder of the networks; empty: DefaultModelFolder()
  // Masks of the person, as many as the video has frames: a video, or a folder of pictures in the
  // order of their names, white (above 127) inside.
  std::filesystem::path masks = {};       // used in place of extracted silhouettes; empty: none
  std::filesystem::path true_masks = {};  // only compared with the silhouettes; empty: none
};

// The refined surface as morph targets of performance.glb. Every frame of it is in surface.pc2.
enum class SurfaceTargets {
  kNone,  // bones alone
  kKey,   // ten targets per second, blended in between; report.json states the error
  kFull,  // every frame exactly; many viewers stop at some hundred targets (docs/outputs.md)
};

struct CaptureOptions {
  PoseOptions pose;          // its num_threads serves every stage
  double height_m = 0;       // the actor is first scaled to this height at bind; 0: as in the file
  bool overlay = true;       // write overlay.mp4
  bool masks = true;         // find silhouettes, refine what they show, write masks.mp4
  bool person_masks = true;  // the networks' masks, where they are run, help to find silhouettes
  // Estimate how a camera turns whose place is not known, where it does not rest; the paper's rests.
  bool camera_turns = true;
  ClipDetectorOptions detect;        // when no detections are given
  ClipRefinementOptions refinement;  // its num_threads is that of `pose`
  SurfaceTargets surface = SurfaceTargets::kKey;

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

struct StageSeconds {
  std::string stage;
  double seconds = 0;
  double core_seconds = 0;  // of all threads of the process, encoders and decoders among them
};

// What came out; report.json holds the same (docs/formats.md, "Report").
struct CaptureReport {
  bool complete = true;  // false: the progress callback stopped the work
  double fps = 0;
  int num_frames = 0;
  Camera camera;          // for the video's own resolution
  double focal_35mm = 0;  // as the video's file says, for an estimated focal length; 0: it does not
  // Relative standard deviation of an estimated focal length; NaN when the camera is given.
  double focal_uncertainty = std::numeric_limits<double>::quiet_NaN();
  Skeleton skeleton;  // the actor's, with the proportions applied
  PoseTrack track;    // poses N x F of `skeleton`, the refined ones where there are
  // Intersection over union of the posed mesh, before refinement, and the networks' mask; F, NaN
  // for frames they did not look at; empty with given detections.
  std::vector<double> person_iou;
  WorldPlacement world;
  std::vector<RefinementRecord> refinement;  // one per frame; empty without the stage
  GltfSurfaceError surface;                  // of the morph targets
  RigMap mapping;
  std::vector<std::string> rig_bones;  // names, indexed by the mapping
  double height_scale = 1;             // applied to the actor's file for height_m
  std::vector<std::string> outputs;    // file names inside the output folder
  std::vector<std::string> warnings;   // one sentence each
  std::vector<StageSeconds> timings;
};

class Capture {
 public:
  // Reads and checks every input and the output folder (made when it is missing), before any long
  // work. Throws Error with one sentence: kFileNotFound, kBadFile, kMismatch (frame counts, sizes,
  // aspect ratio), kUnsupported, kInvalidArgument, kWriteFailed.
  Capture(CaptureInputs inputs, std::filesystem::path output, CaptureOptions options = {});
  ~Capture();
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;

  // Without detections finds them first (detections2d.json, detections3d.json). Writes
  // performance.glb, motion.bvh, joints.trc, poses.json, masks.mp4, surface.pc2, overlay.mp4 and,
  // last, report.json, each file whole or not at all. A progress callback that returns false ends the
  // work: files that are finished stay, and the report says "complete": false. Memory does not grow
  // with the video's pictures. Throws Error (kWriteFailed, kBadFile for a video that breaks off,
  // kMismatch for masks of another number of frames).
  CaptureReport Run(const ProgressCallback& progress = {});

 private:
  struct Inputs;
  int FramesPerTarget() const;

  std::unique_ptr<Inputs> loaded_;
  CaptureInputs inputs_;
  std::filesystem::path output_;
  CaptureOptions options_;
};

}  // namespace mpc
