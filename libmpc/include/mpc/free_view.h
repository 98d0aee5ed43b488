// Purpose: a captured performance seen from any camera: textured over a background, or as a mask.
// Frames: as docs/conventions.md. Units: metres, radians, pixels. Symbols: F frames, V vertices.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/progress.h"
#include "mpc/skeleton/rig_asset.h"
#include "mpc/take.h"

namespace mpc {

// A moving surface before a camera. What is referred to must outlive it.
struct ViewedSurface {
  const RigAsset& rig;  // triangles, and textures where it has some
  Camera camera;        // of the pictures; where it stands does not matter here
  double fps = 0;
  int num_frames = 0;
  // All vertices of the rig, its meshes one after the other, in the camera's frame: 3xV. Called once
  // per frame, in order, from the thread that renders.
  std::function<void(int frame, Eigen::Matrix3Xf* vertices_in_camera)> vertices = {};
  std::vector<std::filesystem::path> inputs = {};  // never to be written over
};

struct TakeView {
  // "FILE.json" or "FILE.json:NAME", in the world of the capture's own camera; with "frames" a path;
  // empty: the capture's own.
  std::string camera = {};
  // The person turns so far about the vertical, anticlockwise seen from above.
  double orbit_rad = 0;
};

// The take's surface.pc2, or without one its poses with skinning. The capture's report.json gives
// the world wherever it is needed: for a surface.pc2, another camera, or an orbit. `take` must
// outlive the result. Throws Error: what the readers throw, and kMismatch for files of another
// capture, cameras of unknown place, or a path of another length.
ViewedSurface ViewOfTake(const Take& take, const TakeView& view = {});

struct RenderOptions {
  // A picture, or a video or folder of at least F frames; empty: plain grey.
  std::filesystem::path background = {};
  bool mask = false;    // white on black in place of pictures
  int num_threads = 0;  // 0: all cores; results do not depend on it
};

// Renders every frame: a video when `output` ends in .mp4, else pictures 000000.png, ... in a folder,
// whole or not at all. Progress is stage "render"; false when the callback stopped it. Holds two
// frames per thread. Throws Error: kInvalidArgument when an input would be overwritten, kMismatch
// for a background of another size or too few frames, kBadFile for a texture that is no picture,
// kWriteFailed.
bool RenderSurface(const ViewedSurface& surface, const std::filesystem::path& output,
                   const RenderOptions& options = {}, const ProgressCallback& progress = {});

}  // namespace mpc
