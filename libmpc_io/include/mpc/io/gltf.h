// Purpose: read an actor from glTF 2.0 and write that actor's performance as glTF.
// Source: Khronos glTF 2.0 specification, 3.6 (accessors), 3.7.3 (skins), 3.11 (animation).
// Frames: scene frame of the file, right-handed, y up. Camera frame: x right, y down, z forward.
// Units: metres, seconds. Symbols: B bones, F frames, V vertices.
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc {

// Reads the skinned meshes of the default scene of a .glb or .gltf. The mesh is placed where a
// viewer shows it: with P = (rest transform of the skin's root joint) * (its inverse bind matrix),
// vertices are P x and scene_from_bone = P * inverse(inverse bind matrix). When the nodes' rest
// pose is the bind pose, that is the rest pose; when it is not, it is the bind pose hung on the
// root joint. Meshes without a skin are left out with a warning. A primitive keeps all vertices of
// its accessors, 4 influences per JOINTS_n set.
// Throws Error: kFileNotFound; kBadFile (broken file, naming the place; no skinned mesh);
// kUnsupported (Draco or meshopt compression, mirrored bones).
RigAsset ReadRigGltf(const std::filesystem::path& path);

class Pc2Reader;

struct GltfPerformance {
  std::vector<double> times_s;  // F, strictly increasing, from 0 or later; the video's own times
  std::vector<std::vector<Eigen::Affine3d>> scene_from_bone;  // F x B
  std::optional<Camera> camera;                               // intrinsics
  // Where the camera is: one place, or F of a moving camera. Needed with `camera`.
  std::vector<Eigen::Isometry3d> scene_from_camera = {Eigen::Isometry3d::Identity()};
  // The surface: F frames of the rig's vertices, its meshes one after the other, in the scene. It
  // becomes morph targets, which viewers add before they skin. Null: the skinned mesh alone.
  Pc2Reader* surface = nullptr;
  int frames_per_target = 1;  // 1: one target per frame; n: every n-th frame and the last
};

// How far shown vertices are from the surface, over all frames and vertices.
struct GltfSurfaceError {
  int num_targets = 0;
  double mean_m = 0;
  double max_m = 0;
};

// Writes a .glb: the source's nodes, names, skin, materials, textures and images as they are, its
// animations replaced by one named "performance" with linear keys at times_s (rotation of every
// bone; translation of the roots and of bones that move in their parent by more than 2 um; scale
// where it changes by more than 1e-4), and the camera as a node,
// animated when it moves. glTF cameras have no principal
// point and no distortion: the exact intrinsics are in the node's extras.mpc_camera.
//
// With a surface each mesh gets a morph target (positions, no normals) per frame or per n frames,
// after those it had, whose weights become 0. A target is the frame's vertex taken back through the
// frame's linear skinning, less the vertex at bind; vertices that skinning brings within 10 um of
// their place are left out, and a target that most vertices are left out of is sparse. The weights'
// keys are linear from target to target, 1 at a target's own frame. Vertices that no bone moves
// cannot follow. The surface is read and written frame by frame; memory holds a few frames.
//
// `rig` is what ReadRigGltf(source) returned, or the same with other proportions: then positions,
// normals, tangents, inverse bind matrices and rest transforms are rewritten to follow it.
// Throws Error: kInvalidArgument (sizes, times, non-finite), kMismatch (rig is not the source's, a
// surface of other sizes), kUnsupported (a file above 4 GB; a surface of a mesh with two skins),
// kWriteFailed, and all that ReadRigGltf throws.
GltfSurfaceError WriteGltfPerformance(const std::filesystem::path& path,
                                      const std::filesystem::path& source, const RigAsset& rig,
                                      const GltfPerformance& performance);

}  // namespace mpc
