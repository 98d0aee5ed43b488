// Purpose: where a performance stands: the frames of joints.trc and of performance.glb, from the
// camera's extrinsics or from gravity and floor as the person shows them.
// Source: ours (docs/conventions.md, "World").
// Frames: camera (OpenCV axes); world: joints.trc; scene: performance.glb and motion.bvh, y up,
// floor at y = 0. Units: metres. Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/rigid.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {

// Where the camera is in each of F frames: in the world when `motion` (F) or the camera's extrinsics say
// so, else nowhere, which is the identity: the base is the world or the camera at rest. Throws Error
// (kMismatch) when `motion` has another length than F.
std::vector<Rigid<WorldFrame, CameraFrame>> BaseFromCamera(const Camera& camera,
                                                           std::span<const CameraFromWorld> motion,
                                                           Eigen::Index num_frames);

// From the middle of the ankles to the middle of the trunk, unit, in the pose's frame: whoever
// stands keeps that over the feet, also when leaning. The skeleton has the paper's joints.
Eigen::Vector3d StandingDirection(const Skeleton& skeleton, const KinematicState& state);

// `up`, or the nearest axis of its frame when that is within 25 degrees.
Eigen::Vector3d SnappedToAxis(const Eigen::Vector3d& up);

struct SceneFrame {};  // right-handed, y up, floor at y = 0, metres

struct WorldPlacement {
  // With extrinsics the camera file's world, else the scene: the origin on the floor under the
  // camera, which looks towards -z.
  Rigid<WorldFrame, CameraFrame> world_from_camera;  // of a moving camera: in the first frame
  std::vector<Rigid<WorldFrame, CameraFrame>> moving_world_from_camera;  // F; empty: it stands
  Rigid<SceneFrame, WorldFrame> scene_from_world;
  Eigen::Vector3d up_in_camera = -Eigen::Vector3d::UnitY();  // unit, as used
  int num_upright_frames = 0;         // frames that showed where up is; 0: the picture's up
  std::vector<std::string> warnings;  // one sentence each

  Rigid<SceneFrame, CameraFrame> scene_from_camera() const {
    return scene_from_world * world_from_camera;
  }
  // In frame f.
  const Rigid<WorldFrame, CameraFrame>& WorldFromCamera(Eigen::Index f) const {
    return moving_world_from_camera.empty() ? world_from_camera
                                            : moving_world_from_camera[static_cast<size_t>(f)];
  }
  Rigid<SceneFrame, CameraFrame> SceneFromCamera(Eigen::Index f) const {
    return scene_from_world * WorldFromCamera(f);
  }
};

// Up is the robust mean direction from the ankles to the trunk over the frames that stand upright;
// with extrinsics it snaps to the world's nearest axis within 25 degrees. The floor lies at the
// 20th percentile over the frames of the mesh's lowest point. `poses` are N x F in the camera
// frame. `motion` is where a moving camera is in each frame, in place of the camera's own
// extrinsics (in the world where it has any, else in a frame whose axes are roughly the camera's);
// empty: it stands. Throws Error (kMismatch) when it has another length than F.
// O(F V); the result does not depend on num_threads.
WorldPlacement PlaceInWorld(const Character& character, const Eigen::MatrixXd& poses,
                            const Camera& camera, std::span<const CameraFromWorld> motion = {},
                            int num_threads = 0);

}  // namespace mpc
