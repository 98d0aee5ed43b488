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

struct GltfPerformance {
  std::vector<double> times_s;  // F, strictly increasing, from 0 or later; the video's own times
  std::vector<std::vector<Eigen::Affine3d>> scene_from_bone;  // F x B
  std::optional<Camera> camera;                               // intrinsics
  // Where the camera is: one place, or F of a moving camera. Needed with `camera`.
  std::vector<Eigen::Isometry3d> scene_from_camera = {Eigen::Isometry3d::Identity()};
};

// Writes a .glb: the source's nodes, names, skin, materials, textures and images as they are, its
// animations replaced by one named "performance" with linear keys at times_s (rotation of every
// bone; translation of the roots and of bones that move in their parent by more than 2 um; scale
// where it changes by more than 1e-4), and the camera as a node,
// animated when it moves. glTF cameras have no principal
// point and no distortion: the exact intrinsics are in the node's extras.mpc_camera.
//
// `rig` is what ReadRigGltf(source) returned, or the same with other proportions: then positions,
// normals, tangents, inverse bind matrices and rest transforms are rewritten to follow it.
// Throws Error: kInvalidArgument (sizes, times, non-finite), kMismatch (rig is not the source's),
// kWriteFailed, and all that ReadRigGltf throws.
void WriteGltfPerformance(const std::filesystem::path& path, const std::filesystem::path& source,
                          const RigAsset& rig, const GltfPerformance& performance);

}  // namespace mpc
