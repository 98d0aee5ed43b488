// Purpose: pictures and exact masks of an actor in a made-up place with light, shadows, moving things
// in the background, occluders, motion blur and sensor noise.
// Source: ours (docs/synthetic.md).
// Frames: world, y up, floor at y = 0. Units: metres, seconds, pixels. Symbols: V vertices.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string_view>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/eval/stool.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc {

enum class PlaceKind { kRoom, kStreet, kPark };
inline constexpr std::array<PlaceKind, 3> kAllPlaces = {PlaceKind::kRoom, PlaceKind::kStreet,
                                                        PlaceKind::kPark};

// Short lower-case name, such as "room".
std::string_view PlaceName(PlaceKind kind);

struct SceneOptions {
  PlaceKind place = PlaceKind::kRoom;
  uint64_t seed = 1;              // of place, light, colours and sensor noise
  bool moving_background = true;  // something swings, rolls or passes by behind the actor
  bool occluders = false;         // a post and a box between camera and actor
  double shutter = 0.5;     // how long it is open, in frames, 0 to 1; centred on the frame's time
  int samples = 4;          // pictures per frame that are averaged, 1 to 64: blur, smooth edges
                            // and soft shadows
  double sensor_noise = 2;  // standard deviation per channel, of 255; 0 to 100

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

// Where actor and camera are during the whole clip.
struct StageBounds {
  Eigen::AlignedBox3d actor;
  Eigen::AlignedBox3d camera;  // its centre
  double half_fov_rad = 0.5;   // of the wider side
  std::optional<Stool> stool;  // that the actor sits on; it hides and shades as an occluder does
};

// What is seen at one moment.
struct SceneMoment {
  Eigen::Matrix3Xf vertices;  // 3xV, the actor's
  CameraFromWorld camera_from_world;
};

// Immutable after construction; all functions are thread-safe.
class SyntheticScene {
 public:
  // The actor is drawn with its rig's textures; without, in plausible colours: skin, hair, shirt,
  // trousers and shoes by body segment. Throws Error: kInvalidArgument for options or a rig of
  // another character, kBadFile for a texture that cannot be decoded, kUnsupported when occluders
  // do not fit between actor and camera.
  // `at_rest`: pictures of this camera are wanted; its place is drawn once, and per picture only what
  // the actor and other moving things can cover or shade. nullptr: the camera moves.
  SyntheticScene(const SceneOptions& options, const StageBounds& stage, const RigAsset& rig,
                 const Character& character, const Camera* at_rest = nullptr);
  ~SyntheticScene();
  SyntheticScene(const SyntheticScene&) = delete;
  SyntheticScene& operator=(const SyntheticScene&) = delete;

  // The picture of frame `frame` (8-bit BGR) from the moment itself and its neighbours, between
  // which vertices and camera are interpolated while the shutter is open. The first and the last
  // frame of a clip are their own neighbours.
  cv::Mat Picture(const Camera& camera, const SceneMoment& previous, const SceneMoment& current,
                  const SceneMoment& next, int frame, double fps) const;

  // 255 where the actor is seen at the moment itself, sharp, without what an occluder hides: a pixel
  // is the actor's when its centre is, as in RasterizeMesh.
  cv::Mat Mask(const Camera& camera, const SceneMoment& moment) const;

  // What can hide the actor, occluders and a stool, as one mesh in the world; empty without.
  const TriangleMesh& occluders() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mpc
