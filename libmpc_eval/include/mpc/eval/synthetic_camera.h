// Purpose: the camera of a synthetic performance: at rest, turning after the actor, or held in hands.
// Frames: world, y up, floor at y = 0; the camera stands towards +z of the actor and looks along -z,
// slightly down. Units: metres, radians, seconds, pixels. Symbols: V vertices, F frames.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "mpc/core/camera.h"

namespace mpc {

enum class CameraMotion {
  kStatic,
  kPan,       // on a tripod: stands still and turns after the actor
  kHandheld,  // walks along with the actor and shakes
};
inline constexpr std::array<CameraMotion, 3> kAllCameraMotions = {
    CameraMotion::kStatic, CameraMotion::kPan, CameraMotion::kHandheld};

// Short lower-case name, such as "pan".
std::string_view CameraMotionName(CameraMotion motion);

struct SyntheticCameraOptions {
  int width = 960;  // px, 16 to 4096
  int height = 720;
  double fov_rad = 1.0471975511965976;  // of the longer side, 10 to 120 degrees
  CameraMotion motion = CameraMotion::kStatic;
  double shake = 1;   // of kHandheld: 1 is a hand's 0.4 degrees and 15 mm root mean square; 0 to 10
  uint64_t seed = 1;  // of the shaking

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

struct SyntheticCamera {
  Camera camera;                        // with extrinsics: those of the first frame
  std::vector<CameraFromWorld> motion;  // F, or empty for a camera at rest

  const CameraFromWorld& At(int frame) const {
    return motion.empty() ? camera.camera_from_world : motion[static_cast<size_t>(frame)];
  }
  // The camera in a frame.
  Camera InFrame(int frame) const;
};

// As near as the whole actor, given by the vertices of every frame (3xV, world), stays inside the
// middle nine tenths of the picture in all frames. Throws Error (kInvalidArgument) without frames
// or vertices. O(F).
SyntheticCamera MakeSyntheticCamera(const std::vector<Eigen::Matrix3Xf>& vertices, double fps,
                                    const SyntheticCameraOptions& options);

}  // namespace mpc
