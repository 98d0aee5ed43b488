#include "gltf_nodes.h"

#include <Eigen/SVD>

namespace mpc::internal {
namespace {

// A node's own translation, rotation and scale, as a viewer takes them.
Trs RestOf(const GltfDocument& document, int index) {
  const tinygltf::Node& node = document.model.nodes[index];
  if (!node.matrix.empty()) return Decompose(document.LocalTransform(index));
  Trs trs;
  trs.translation = document.LocalTransform(index).translation();
  if (!node.rotation.empty()) {
    trs.rotation = Eigen::Quaterniond(Eigen::Vector4d(node.rotation.data())).normalized();
  }
  if (!node.scale.empty()) trs.scale = Eigen::Vector3d(node.scale.data());
  return trs;
}

}  // namespace

Eigen::Affine3d Trs::Transform() const {
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  transform.linear() = rotation.toRotationMatrix() * scale.asDiagonal();
  transform.translation() = translation;
  return transform;
}

Trs Decompose(const Eigen::Affine3d& transform) {
  Trs trs;
  trs.translation = transform.translation();
  trs.scale = transform.linear().colwise().norm();
  if (transform.linear().determinant() < 0) trs.scale *= -1;
  Eigen::Matrix3d rotation = transform.linear() * trs.scale.cwiseInverse().asDiagonal();
  if ((rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).norm() > 1e-6) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(transform.linear(),
                                                Eigen::ComputeFullU | Eigen::ComputeFullV);
    rotation = svd.matrixU() * svd.matrixV().transpose();
    if (rotation.determinant() < 0) rotation *= -1;
    trs.scale = (rotation.transpose() * transform.linear()).diagonal();
  }
  trs.rotation = Eigen::Quaterniond(rotation).normalized();
  return trs;
}

std::vector<int> NodesInOrder(const GltfDocument& document) {
  const int num_nodes = static_cast<int>(document.parent.size());
  std::vector<int> order;
  for (int n = 0; n < num_nodes; ++n) {
    if (document.parent[n] < 0) order.push_back(n);
  }
  for (size_t i = 0; i < order.size(); ++i) {
    const std::vector<int>& children = document.model.nodes[order[i]].children;
    order.insert(order.end(), children.begin(), children.end());
  }
  return order;
}

std::vector<int> BoneOfNode(const GltfDocument& document, const RigAsset& rig) {
  std::vector<int> bone_of_node(document.parent.size(), -1);
  for (size_t b = 0; b < rig.bones.size(); ++b) {
    bone_of_node[rig.bones[b].node] = static_cast<int>(b);
  }
  return bone_of_node;
}

std::vector<Trs> WriteRestPose(const GltfDocument& document, const RigAsset& rig,
                               bool other_proportions, nlohmann::ordered_json* json) {
  const std::vector<int> bone_of_node = BoneOfNode(document, rig);
  std::vector<Trs> rest(rig.bones.size());
  std::vector<Eigen::Affine3d> world(document.parent.size());
  for (const int n : NodesInOrder(document)) {
    const Eigen::Affine3d parent =
        document.parent[n] < 0 ? Eigen::Affine3d::Identity() : world[document.parent[n]];
    const int bone = bone_of_node[n];
    if (bone < 0) {
      world[n] = parent * document.LocalTransform(n);
      continue;
    }
    rest[bone] = other_proportions ? Decompose(parent.inverse() * rig.bones[bone].scene_from_bone)
                                   : RestOf(document, n);
    world[n] = parent * rest[bone].Transform();
    nlohmann::ordered_json& node = (*json)["nodes"][n];
    if (!other_proportions && !node.contains("matrix")) continue;
    node.erase("matrix");
    node["translation"] = ToJson(rest[bone].translation);
    node["rotation"] = ToJson(rest[bone].rotation.coeffs());
    node["scale"] = ToJson(rest[bone].scale);
  }
  return rest;
}

}  // namespace mpc::internal
