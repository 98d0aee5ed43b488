// Purpose: somebody's rigged mesh as plain data, in its own frame: bones, bind pose, meshes.
// Frames: scene frame of the file (glTF: right-handed, y up). Units: metres.
// Symbols: B bones, V vertices, T triangles.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

struct RigBone {
  std::string name;
  int parent = -1;  // index into bones of the nearest ancestor that is a bone; -1: none
  int node = -1;    // the file's own node index
  // Where the bone is when the mesh is as modelled: the inverse of the inverse bind matrix, times
  // the mesh's scene placement. May hold scale; never a reflection.
  Eigen::Affine3d scene_from_bone = Eigen::Affine3d::Identity();
};

// One skinned mesh primitive, all vertices in the scene frame at bind.
struct RigMesh {
  std::string name;
  TriangleMesh mesh;
  Eigen::MatrixXi bones;    // KxV, indices into RigAsset::bones; 0 where the weight is 0
  Eigen::MatrixXf weights;  // KxV, as in the file
  Eigen::Matrix2Xf uv;      // 2xV or empty
  // Base colour as an encoded picture (PNG or JPEG, bytes of the file); empty: none. Needs uv.
  std::vector<unsigned char> texture;
  int file_mesh = -1;  // the file's own mesh and primitive index
  int file_primitive = -1;
};

struct RigAsset {
  std::string source;  // file name, for messages
  std::vector<RigBone> bones;
  std::vector<RigMesh> meshes;

  int num_vertices() const;
  int FindBone(const std::string& name) const;

  // Throws Error (kBadFile) naming every fault that makes the rig unusable: no bones, no skinned
  // mesh, indices out of range, non-finite numbers.
  void Validate() const;
};

// What is wrong with the weights, for warnings: weights that are negative, do not sum to one within
// 1e-2, or are all zero. Empty when nothing is.
std::vector<std::string> CheckWeights(const RigAsset& rig);

}  // namespace mpc
