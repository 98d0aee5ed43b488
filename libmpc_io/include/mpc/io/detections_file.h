// Purpose: read joint detections of other programs and our own format; write ours.
// Source: OpenPose BODY_25B, MediaPipe BlazePose (33 landmarks); docs/formats.md, "Detections".
// Units: 2D in pixels of the video as stored; 3D in metres, x right, y down, z away.
//
// The kind of file is found from its content:
//   packed OpenPose   {"names": [25], "det": F x 25 x [x, y, confidence]}             2D
//   packed BlazePose  {"frames": F x {"persons": [{"landmarks", "world"}]}}           2D and 3D
//   our own           {"format": "mpc-detections", "version": 1, ...}                 2D or 3D
//
// A frame or joint that was not seen gets confidence 0. Of several BlazePose persons the one that
// is largest over the whole clip is taken (by "id" where all persons have one, else per frame).
// BlazePose hips are moved by 7 % of the torso towards the shoulders, where joint centres are; neck
// and head top are computed from shoulders and ears; its 3D follows the viewing ray.
//
// All readers throw Error: kFileNotFound; kBadFile naming file and place; kUnsupported for a valid
// file without the wanted kind of detection.
#pragma once

#include <filesystem>

#include "mpc/core/detections.h"

namespace mpc {

Detections2d ReadDetections2d(const std::filesystem::path& path);
Detections3d ReadDetections3d(const std::filesystem::path& path);

// Writes our own format; coordinates keep 1e-4 px and 1e-6 m. Throws Error: kInvalidArgument for
// detections that do not validate, kWriteFailed.
void WriteDetections(const std::filesystem::path& path, const Detections2d& detections);
void WriteDetections(const std::filesystem::path& path, const Detections3d& detections);

}  // namespace mpc
