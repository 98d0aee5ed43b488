// Purpose: read and write cameras.json (docs/formats.md, "Cameras").
// Frames: x_in_camera = R x_in_world + t, OpenCV axes. Units: metres, pixels of the stored video.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mpc/core/camera.h"

namespace mpc {

// All cameras of a file, at least one. Throws Error: kFileNotFound, kBadFile (naming file, camera
// and field: wrong sizes, non-finite numbers, a rotation that is not orthonormal, two cameras of
// the same name), kUnsupported for distortion models with more than five coefficients.
std::vector<Camera> ReadCameras(const std::filesystem::path& path);

// One camera, given as "file.json" (of a file with one camera) or "file.json:name". Throws Error
// (kInvalidArgument) listing the names when the name is missing or unknown.
Camera ReadCamera(const std::string& spec);

// Where a moving camera is in each frame of its video: the member "frames" of the camera that `spec`
// names as in ReadCamera. Empty for a camera that does not move. Throws as ReadCamera.
std::vector<CameraFromWorld> ReadCameraMotion(const std::string& spec);

// Writes one moving camera: its own R and t are those of the first of `motion`, which must not be
// empty. Throws as WriteCameras.
void WriteMovingCamera(const std::filesystem::path& path, const Camera& camera,
                       const std::vector<CameraFromWorld>& motion);

// Writes all cameras, those with extrinsics with R and t. Throws Error: kInvalidArgument for a
// camera that does not validate, kWriteFailed.
void WriteCameras(const std::filesystem::path& path, const std::vector<Camera>& cameras);

}  // namespace mpc
