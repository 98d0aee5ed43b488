// Purpose: a loaded glTF file, checked enough that its accessors can be read safely.
#pragma once

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "mpc/skeleton/rig_asset.h"

namespace mpc::internal {

// Whether bytes begin as a PNG or JPEG file does.
bool IsEncodedImage(const std::vector<unsigned char>& bytes);

struct GltfDocument {
  std::string source;           // file name, for messages
  nlohmann::ordered_json json;  // the file's own JSON, to be written again as it is
  tinygltf::Model model;        // the same parsed, with buffers and images loaded (not decoded)
  std::vector<int> parent;      // per node, -1: none; free of cycles
  std::vector<bool> in_scene;   // per node: belongs to the default scene

  Eigen::Affine3d LocalTransform(int node) const;  // parent_from_node at rest
  Eigen::Affine3d WorldTransform(int node) const;  // scene_from_node at rest

  // An accessor's content, components x count, normalised integers as fractions. Throws Error
  // (kBadFile) when it does not lie within its buffer or has another number of components.
  Eigen::MatrixXd ReadAccessor(int accessor, int num_components, const std::string& what) const;

  // The encoded base colour texture of a material: a PNG or JPEG, from a buffer view, a data URI or
  // a file beside. Empty when it has none, or, with a warning, when it is no such picture or is to
  // be used with other texture coordinates than TEXCOORD_0.
  std::vector<unsigned char> ReadBaseColour(int material) const;

  [[noreturn]] void Fail(const std::string& fault) const;
};

GltfDocument LoadGltf(const std::filesystem::path& path);

// A rig with what writing needs to know about where it came from.
struct GltfRig {
  RigAsset rig;
  std::vector<int> mesh_skin;                   // per rig mesh: the file's skin
  std::vector<Eigen::Affine3d> skin_placement;  // per skin of the file: scene from mesh at bind
  std::vector<std::vector<int>> skin_bones;     // per skin and joint: index of the rig's bone
  std::vector<std::vector<Eigen::Affine3d>> skin_bone_from_mesh;  // the same: inverse bind matrix
};

GltfRig BuildRig(const GltfDocument& document);

}  // namespace mpc::internal
