#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "gltf_document.h"
#include "mpc/core/error.h"
#include "mpc/core/log.h"
#include "mpc/io/gltf.h"

namespace mpc {
namespace internal {
namespace {

std::string MeshLabel(const GltfDocument& document, int mesh, size_t primitive) {
  return fmt::format("mesh {} ({}) primitive {}", mesh, document.model.meshes[mesh].name,
                     primitive);
}

// The triangles of a primitive, strips and fans taken apart.
Triangles ReadTriangles(const GltfDocument& document, const tinygltf::Primitive& primitive,
                        Eigen::Index num_vertices, const std::string& what) {
  std::vector<int> corners;
  if (primitive.indices >= 0) {
    const Eigen::MatrixXd indices = document.ReadAccessor(primitive.indices, 1, what + " indices");
    for (const double index : indices.reshaped()) {
      if (index < 0 || index >= static_cast<double>(num_vertices)) {
        document.Fail(fmt::format("{} has vertex index {} of {}", what, index, num_vertices));
      }
      corners.push_back(static_cast<int>(index));
    }
  } else {
    for (int v = 0; v < num_vertices; ++v) corners.push_back(v);
  }
  const int n = static_cast<int>(corners.size());
  if (primitive.mode == TINYGLTF_MODE_TRIANGLES) {
    if (n % 3 != 0) document.Fail(fmt::format("{} has {} indices, not a multiple of 3", what, n));
    return Eigen::Map<const Triangles>(corners.data(), 3, n / 3);
  }
  Triangles triangles(3, std::max(n - 2, 0));
  for (int t = 0; t + 2 < n; ++t) {
    if (primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN) {
      triangles.col(t) << corners[0], corners[t + 1], corners[t + 2];
    } else {
      const int odd = t % 2;
      triangles.col(t) << corners[t], corners[t + 1 + odd], corners[t + 2 - odd];
    }
  }
  return triangles;
}

// Joints and weights of all JOINTS_n/WEIGHTS_n sets, stacked; joints are the skin's own indices.
void ReadInfluences(const GltfDocument& document, const tinygltf::Primitive& primitive,
                    Eigen::Index num_vertices, size_t num_joints, const std::string& what,
                    Eigen::MatrixXi* joints, Eigen::MatrixXd* weights) {
  joints->resize(0, num_vertices);
  weights->resize(0, num_vertices);
  for (int set = 0;; ++set) {
    const auto j = primitive.attributes.find(fmt::format("JOINTS_{}", set));
    const auto w = primitive.attributes.find(fmt::format("WEIGHTS_{}", set));
    if (j == primitive.attributes.end() || w == primitive.attributes.end()) break;
    const Eigen::MatrixXd set_joints = document.ReadAccessor(j->second, 4, what + " joints");
    const Eigen::MatrixXd set_weights = document.ReadAccessor(w->second, 4, what + " weights");
    if (set_joints.cols() != num_vertices || set_weights.cols() != num_vertices) {
      document.Fail(fmt::format("{} has {} positions, {} joints and {} weights", what, num_vertices,
                                set_joints.cols(), set_weights.cols()));
    }
    joints->conservativeResize(joints->rows() + 4, Eigen::NoChange);
    weights->conservativeResize(weights->rows() + 4, Eigen::NoChange);
    joints->bottomRows<4>() = set_joints.cwiseMax(-1).cwiseMin(1 << 30).cast<int>();
    weights->bottomRows<4>() = set_weights;
  }
  if (joints->rows() == 0) document.Fail(what + " has a skin but no joints and weights");
  for (Eigen::Index v = 0; v < num_vertices; ++v) {
    for (Eigen::Index k = 0; k < joints->rows(); ++k) {
      int& joint = (*joints)(k, v);
      if (joint >= 0 && joint < static_cast<int>(num_joints)) continue;
      if ((*weights)(k, v) != 0) {
        document.Fail(
            fmt::format("{} vertex {} follows joint {} of {}", what, v, joint, num_joints));
      }
      joint = 0;
    }
  }
}

class RigBuilder {
 public:
  explicit RigBuilder(const GltfDocument& document) : document_(document) {
    out_.rig.source = document.source;
    out_.skin_placement.resize(document.model.skins.size(), Eigen::Affine3d::Identity());
    out_.skin_bones.resize(document.model.skins.size());
    out_.skin_bone_from_mesh.resize(document.model.skins.size());
  }

  GltfRig Build() {
    std::set<std::pair<int, int>> done;  // mesh and skin: instances are read once
    for (size_t n = 0; n < document_.model.nodes.size(); ++n) {
      const tinygltf::Node& node = document_.model.nodes[n];
      if (node.mesh < 0 || !document_.in_scene[n]) continue;
      if (node.mesh >= static_cast<int>(document_.model.meshes.size())) {
        document_.Fail(
            fmt::format("node {} has mesh {} of {}", n, node.mesh, document_.model.meshes.size()));
      }
      if (node.skin < 0) {
        LogWarning(fmt::format("{}: mesh {} ({}) has no skin and is left out", document_.source,
                               node.mesh, document_.model.meshes[node.mesh].name));
        continue;
      }
      if (node.skin >= static_cast<int>(document_.model.skins.size())) {
        document_.Fail(
            fmt::format("node {} has skin {} of {}", n, node.skin, document_.model.skins.size()));
      }
      if (!done.emplace(node.mesh, node.skin).second) continue;
      if (out_.skin_bones[node.skin].empty()) AddSkin(node.skin);
      AddMesh(node.mesh, node.skin);
    }
    if (out_.rig.meshes.empty()) {
      document_.Fail("no skinned mesh: nodes with both a mesh and a skin are needed");
    }
    LinkBones();
    out_.rig.Validate();
    return std::move(out_);
  }

 private:
  // The first joint of the skin that has none of the skin's joints above it.
  size_t RootJoint(const std::vector<int>& joints) const {
    const std::set<int> members(joints.begin(), joints.end());
    for (size_t j = 0; j < joints.size(); ++j) {
      int ancestor = document_.parent[joints[j]];
      while (ancestor >= 0 && !members.contains(ancestor)) ancestor = document_.parent[ancestor];
      if (ancestor < 0) return j;
    }
    return 0;
  }

  void AddSkin(int skin_index) {
    const tinygltf::Skin& skin = document_.model.skins[skin_index];
    const auto num_joints = static_cast<Eigen::Index>(skin.joints.size());
    if (num_joints == 0) document_.Fail(fmt::format("skin {} has no joints", skin_index));
    for (const int node : skin.joints) {
      if (node < 0 || node >= static_cast<int>(document_.model.nodes.size())) {
        document_.Fail(fmt::format("skin {} has joint node {}", skin_index, node));
      }
    }
    std::vector<Eigen::Affine3d> bone_from_mesh(skin.joints.size(), Eigen::Affine3d::Identity());
    if (skin.inverseBindMatrices >= 0) {
      const std::string what = fmt::format("skin {} inverse bind matrices", skin_index);
      const Eigen::MatrixXd matrices = document_.ReadAccessor(skin.inverseBindMatrices, 16, what);
      if (matrices.cols() < num_joints) {
        document_.Fail(fmt::format("{}: {} for {} joints", what, matrices.cols(), num_joints));
      }
      for (Eigen::Index j = 0; j < num_joints; ++j) {
        bone_from_mesh[j].matrix().topRows<3>() =
            Eigen::Map<const Eigen::Matrix4d>(matrices.col(j).data()).topRows<3>();
      }
    }
    const size_t root = RootJoint(skin.joints);
    const Eigen::Affine3d placement =
        document_.WorldTransform(skin.joints[root]) * bone_from_mesh[root];
    for (size_t j = 0; j < skin.joints.size(); ++j) {
      AddBone(skin_index, skin.joints[j], placement, bone_from_mesh[j]);
    }
    out_.skin_placement[skin_index] = placement;
    out_.skin_bone_from_mesh[skin_index] = std::move(bone_from_mesh);
  }

  // A bone that several skins share keeps the pose of the first.
  void AddBone(int skin, int node, const Eigen::Affine3d& placement,
               const Eigen::Affine3d& bone_from_mesh) {
    const auto [it, is_new] = bone_of_node_.emplace(node, out_.rig.bones.size());
    out_.skin_bones[skin].push_back(static_cast<int>(it->second));
    if (!is_new) return;
    RigBone bone;
    bone.name = document_.model.nodes[node].name;
    bone.node = node;
    bone.scene_from_bone = placement * bone_from_mesh.inverse();
    const double volume = bone.scene_from_bone.linear().determinant();
    if (!bone.scene_from_bone.matrix().allFinite() || volume == 0) {
      document_.Fail(fmt::format("joint {} ({}) has a singular bind matrix", node, bone.name));
    }
    if (volume < 0) {
      throw Error(ErrorCode::kUnsupported,
                  fmt::format("{}: joint {} ({}) is mirrored at bind; apply the negative scale in "
                              "the modelling program",
                              document_.source, node, bone.name));
    }
    out_.rig.bones.push_back(std::move(bone));
  }

  void AddMesh(int mesh_index, int skin_index) {
    const tinygltf::Mesh& mesh = document_.model.meshes[mesh_index];
    for (size_t p = 0; p < mesh.primitives.size(); ++p) {
      const tinygltf::Primitive& primitive = mesh.primitives[p];
      const std::string what = MeshLabel(document_, mesh_index, p);
      if (primitive.mode < TINYGLTF_MODE_TRIANGLES || primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
        LogWarning(fmt::format("{}: {} has no triangles and is left out", document_.source, what));
        continue;
      }
      const auto position = primitive.attributes.find("POSITION");
      if (position == primitive.attributes.end()) document_.Fail(what + " has no positions");
      const Eigen::MatrixXd x_in_mesh =
          document_.ReadAccessor(position->second, 3, what + " positions");

      RigMesh out;
      out.name = mesh.name;
      out.file_mesh = mesh_index;
      out.file_primitive = static_cast<int>(p);
      out.mesh.triangles = ReadTriangles(document_, primitive, x_in_mesh.cols(), what);
      Eigen::MatrixXi joints;
      Eigen::MatrixXd weights;
      ReadInfluences(document_, primitive, x_in_mesh.cols(), out_.skin_bones[skin_index].size(),
                     what, &joints, &weights);
      PlaceVertices(skin_index, x_in_mesh, joints, weights, &out.mesh.positions);
      out.bones.resize(joints.rows(), joints.cols());
      for (Eigen::Index i = 0; i < joints.size(); ++i) {
        out.bones(i) = weights(i) != 0 ? out_.skin_bones[skin_index][joints(i)] : 0;
      }
      out.weights = weights.cast<float>();
      const auto uv = primitive.attributes.find("TEXCOORD_0");
      if (uv != primitive.attributes.end()) {
        out.uv = document_.ReadAccessor(uv->second, 2, what + " texture coordinates").cast<float>();
        if (out.uv.cols() != x_in_mesh.cols()) {
          document_.Fail(fmt::format("{} has {} positions and {} texture coordinates", what,
                                     x_in_mesh.cols(), out.uv.cols()));
        }
        out.texture = document_.ReadBaseColour(primitive.material);
      }
      out_.rig.meshes.push_back(std::move(out));
      out_.mesh_skin.push_back(skin_index);
    }
  }

  // Skins the vertices to the rig's bind pose: the skin's placement, unless it shares bones with a
  // skin of another bind pose.
  void PlaceVertices(int skin, const Eigen::MatrixXd& x_in_mesh, const Eigen::MatrixXi& joints,
                     const Eigen::MatrixXd& weights, Eigen::Matrix3Xf* positions) const {
    std::vector<Eigen::Affine3d> scene_from_mesh;
    for (size_t j = 0; j < out_.skin_bones[skin].size(); ++j) {
      scene_from_mesh.push_back(out_.rig.bones[out_.skin_bones[skin][j]].scene_from_bone *
                                out_.skin_bone_from_mesh[skin][j]);
    }
    positions->resize(3, x_in_mesh.cols());
    for (Eigen::Index v = 0; v < x_in_mesh.cols(); ++v) {
      const Eigen::Vector3d x = x_in_mesh.col(v);
      const double sum = weights.col(v).sum();
      Eigen::Vector3d placed = out_.skin_placement[skin] * x;
      if (sum > 1e-6) {
        const Eigen::Vector3d fallback = placed;
        placed.setZero();
        for (Eigen::Index k = 0; k < weights.rows(); ++k) {
          if (weights(k, v) != 0) {
            placed += weights(k, v) / sum * (scene_from_mesh[joints(k, v)] * x - fallback);
          }
        }
        placed += fallback;
      }
      positions->col(v) = placed.cast<float>();
    }
  }

  void LinkBones() {
    for (RigBone& bone : out_.rig.bones) {
      int node = document_.parent[bone.node];
      while (node >= 0 && !bone_of_node_.contains(node)) node = document_.parent[node];
      bone.parent = node < 0 ? -1 : static_cast<int>(bone_of_node_.at(node));
    }
  }

  const GltfDocument& document_;
  GltfRig out_;
  std::map<int, size_t> bone_of_node_;
};

}  // namespace

GltfRig BuildRig(const GltfDocument& document) { return RigBuilder(document).Build(); }

}  // namespace internal

RigAsset ReadRigGltf(const std::filesystem::path& path) {
  return internal::BuildRig(internal::LoadGltf(path)).rig;
}

}  // namespace mpc
