// Purpose: nodes of a glTF file as translation, rotation and scale.
#pragma once

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <vector>

#include "gltf_document.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc::internal {

struct Trs {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();

  Eigen::Affine3d Transform() const;
};

// The rotation and scale nearest to a transform; exact without shear.
Trs Decompose(const Eigen::Affine3d& transform);

// All nodes, parents before children.
std::vector<int> NodesInOrder(const GltfDocument& document);

// The bone at each node, or -1.
std::vector<int> BoneOfNode(const GltfDocument& document, const RigAsset& rig);

// Rest transforms of the bones' nodes: the source's own, or `rig`'s bind pose when it has other
// proportions. Animated nodes get translation, rotation and scale instead of a matrix.
std::vector<Trs> WriteRestPose(const GltfDocument& document, const RigAsset& rig,
                               bool other_proportions, nlohmann::ordered_json* json);

template <typename Vector>
nlohmann::ordered_json ToJson(const Vector& vector) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) json.push_back(vector[i]);
  return json;
}

}  // namespace mpc::internal
