// Purpose: a second, independent reading of a .glb, as a viewer animates it: node hierarchy, keys,
// skinning. Shares no code with the library.
// Symbols: F frames (keys), V vertices.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace mpc::testing {

struct GltfProbe {
  nlohmann::ordered_json json;
  std::string binary;

  explicit GltfProbe(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    std::uint32_t length = 0;
    std::memcpy(&length, bytes.data() + 12, 4);
    json = nlohmann::ordered_json::parse(bytes.substr(20, length));
    binary = bytes.substr(28 + length);
  }

  std::string ViewBytes(int view_index) const {
    const auto& view = json["bufferViews"][view_index];
    return binary.substr(view.value("byteOffset", 0u), view["byteLength"].get<size_t>());
  }

  // Accessors of floats or unsigned integers, also strided or sparse with 16-bit indices.
  Eigen::MatrixXd Values(int accessor_index) const {
    const auto& accessor = json["accessors"][accessor_index];
    const std::string type = accessor["type"];
    const std::map<std::string, int> rows = {
        {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
    Eigen::MatrixXd values = Eigen::MatrixXd::Zero(rows.at(type), accessor["count"].get<int>());
    const bool normalized = accessor.value("normalized", false);
    const int component = accessor["componentType"];
    const auto read = [&](const char* data) -> double {
      const auto as = [&](auto x) {
        std::memcpy(&x, data, sizeof(x));
        return static_cast<double>(x);
      };
      switch (component) {
        case 5121:
          return as(std::uint8_t{}) / (normalized ? 255 : 1);
        case 5123:
          return as(std::uint16_t{}) / (normalized ? 65535 : 1);
        case 5125:
          return as(std::uint32_t{});
        default:
          return as(float{});
      }
    };
    const size_t size = component == 5121 ? 1 : component == 5123 ? 2 : 4;
    const auto num_rows = static_cast<size_t>(values.rows());
    if (accessor.contains("bufferView")) {
      const size_t stride = json["bufferViews"][accessor["bufferView"].get<int>()].value(
          "byteStride", num_rows * size);
      const std::string data =
          ViewBytes(accessor["bufferView"]).substr(accessor.value("byteOffset", 0u));
      for (Eigen::Index i = 0; i < values.cols(); ++i) {
        for (size_t r = 0; r < num_rows; ++r) {
          values(static_cast<int>(r), i) = read(data.data() + i * stride + r * size);
        }
      }
    }
    if (accessor.contains("sparse")) {
      const auto& sparse = accessor["sparse"];
      const std::string indices = ViewBytes(sparse["indices"]["bufferView"]);
      const std::string data = ViewBytes(sparse["values"]["bufferView"]);
      for (size_t i = 0; i < sparse["count"].get<size_t>(); ++i) {
        std::uint16_t at = 0;
        std::memcpy(&at, indices.data() + 2 * i, 2);
        for (size_t r = 0; r < num_rows; ++r) {
          values(static_cast<int>(r), at) = read(data.data() + (i * num_rows + r) * size);
        }
      }
    }
    return values;
  }

  // scene_from_node of every node at a key of animation 0; at rest for key < 0.
  std::vector<Eigen::Affine3d> NodeWorlds(int key) const {
    const size_t num_nodes = json["nodes"].size();
    std::vector<Eigen::Vector3d> translation(num_nodes, Eigen::Vector3d::Zero());
    std::vector<Eigen::Quaterniond> rotation(num_nodes, Eigen::Quaterniond::Identity());
    std::vector<Eigen::Vector3d> scale(num_nodes, Eigen::Vector3d::Ones());
    std::vector<int> parent(num_nodes, -1);
    for (size_t n = 0; n < num_nodes; ++n) {
      const auto& node = json["nodes"][n];
      for (int i = 0; i < 3; ++i) {
        if (node.contains("translation")) translation[n][i] = node["translation"][i];
        if (node.contains("scale")) scale[n][i] = node["scale"][i];
      }
      for (int i = 0; i < 4 && node.contains("rotation"); ++i) {
        rotation[n].coeffs()[i] = node["rotation"][i];
      }
      if (!node.contains("children")) continue;
      for (const int child : node["children"]) parent[child] = static_cast<int>(n);
    }
    if (key >= 0) {
      const auto& animation = json["animations"][0];
      for (const auto& channel : animation["channels"]) {
        const auto& sampler = animation["samplers"][channel["sampler"].get<int>()];
        const Eigen::VectorXd value = Values(sampler["output"]).col(key);
        const int node = channel["target"]["node"];
        const std::string path = channel["target"]["path"];
        if (path == "translation") translation[node] = value;
        if (path == "rotation") rotation[node].coeffs() = value;
        if (path == "scale") scale[node] = value;
      }
    }
    std::vector<Eigen::Affine3d> worlds(num_nodes);
    for (size_t n = 0; n < num_nodes; ++n) {
      Eigen::Affine3d world = Eigen::Affine3d::Identity();
      for (int a = static_cast<int>(n); a >= 0; a = parent[a]) {
        Eigen::Affine3d local = Eigen::Affine3d::Identity();
        if (json["nodes"][a].contains("matrix")) {
          for (int i = 0; i < 16; ++i) local.matrix()(i) = json["nodes"][a]["matrix"][i];
        } else {
          local = Eigen::Translation3d(translation[a]) * rotation[a].normalized() *
                  Eigen::Scaling(scale[a]);
        }
        world = local * world;
      }
      worlds[n] = world;
    }
    return worlds;
  }

  // Morph weights of a node at a key of the other channels, linear between their own keys.
  std::vector<double> MorphWeights(size_t node, int key) const {
    const auto& animation = json["animations"][0];
    const auto sampler_of = [&](const std::string& path,
                                int of_node) -> const nlohmann::ordered_json* {
      for (const auto& channel : animation["channels"]) {
        const auto& target = channel["target"];
        if (target["path"] == path && (of_node < 0 || target["node"] == of_node)) {
          return &animation["samplers"][channel["sampler"].get<int>()];
        }
      }
      return nullptr;
    };
    const nlohmann::ordered_json* sampler = sampler_of("weights", static_cast<int>(node));
    if (sampler == nullptr) return {};
    const double time = Values((*sampler_of("rotation", -1))["input"])(0, key);
    const Eigen::MatrixXd times = Values((*sampler)["input"]);
    const Eigen::MatrixXd outputs = Values((*sampler)["output"]);
    const Eigen::Index num_targets = outputs.size() / times.size();
    Eigen::Index after = 0;
    while (after + 1 < times.size() && times(after) < time) ++after;
    const Eigen::Index before = times(after) <= time ? after : after - 1;
    const double blend =
        before == after ? 0 : (time - times(before)) / (times(after) - times(before));
    std::vector<double> weights;
    for (Eigen::Index t = 0; t < num_targets; ++t) {
      weights.push_back((1 - blend) * outputs(before * num_targets + t) +
                        blend * outputs(after * num_targets + t));
    }
    return weights;
  }

  // Positions of a primitive with its morph targets, 3xV.
  Eigen::MatrixXd MorphedPositions(int mesh, int primitive, int key) const {
    const auto& shape = json["meshes"][mesh]["primitives"][primitive];
    Eigen::MatrixXd x = Values(shape["attributes"]["POSITION"]);
    if (key < 0 || !shape.contains("targets")) return x;
    for (size_t n = 0; n < json["nodes"].size(); ++n) {
      if (json["nodes"][n].value("mesh", -1) != mesh) continue;
      const std::vector<double> weights = MorphWeights(n, key);
      for (size_t t = 0; t < weights.size(); ++t) {
        if (weights[t] != 0) x += weights[t] * Values(shape["targets"][t]["POSITION"]);
      }
      break;
    }
    return x;
  }

  // Vertices of a primitive as shown: 3xV. Only the first set of four influences.
  Eigen::Matrix3Xd ShownVertices(int mesh, int primitive, int skin_index, int key) const {
    const auto& attributes = json["meshes"][mesh]["primitives"][primitive]["attributes"];
    const Eigen::MatrixXd x = MorphedPositions(mesh, primitive, key);
    const Eigen::MatrixXd joints = Values(attributes["JOINTS_0"]);
    const Eigen::MatrixXd weights = Values(attributes["WEIGHTS_0"]);
    const auto& skin = json["skins"][skin_index];
    const Eigen::MatrixXd inverse_bind = Values(skin["inverseBindMatrices"]);
    const std::vector<Eigen::Affine3d> worlds = NodeWorlds(key);
    Eigen::Matrix3Xd shown = Eigen::Matrix3Xd::Zero(3, x.cols());
    for (Eigen::Index v = 0; v < x.cols(); ++v) {
      for (int k = 0; k < 4; ++k) {
        const int joint = static_cast<int>(joints(k, v));
        Eigen::Affine3d bone_from_mesh = Eigen::Affine3d::Identity();
        bone_from_mesh.matrix() = inverse_bind.col(joint).reshaped(4, 4);
        const Eigen::Vector3d position = x.col(v);
        shown.col(v) += weights(k, v) / weights.col(v).sum() *
                        (worlds[skin["joints"][joint].get<int>()] * bone_from_mesh * position);
      }
    }
    return shown;
  }
};

}  // namespace mpc::testing
