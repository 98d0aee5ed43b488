// Purpose: write a rig as glTF in the many ways exporters do. Shares no code with the library.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "mpc/skeleton/rig_asset.h"

namespace mpc::testing {

struct TestGltfOptions {
  bool armature = false;       // bones and mesh below a node of scale 0.01, turned from z up
  bool matrix_nodes = false;   // node transforms as matrices
  bool short_joints = false;   // joints u16 and weights normalised u16 instead of u8 and float
  bool two_sets = false;       // JOINTS_1/WEIGHTS_1 hold half of every weight
  bool sparse = false;         // positions are zeros with a sparse correction of all
  bool strided = false;        // positions 20 bytes apart
  bool old_animation = false;  // an animation that must not survive
  bool moved_rest = false;     // nodes rest in another pose than the bind pose (the root's stays)
  bool data_uri = false;       // .gltf with the buffer and an image inside, instead of .glb
};

class TestGltf {
 public:
  using Json = nlohmann::ordered_json;

  TestGltf(const RigAsset& rig, const TestGltfOptions& options) : options_(options) {
    json = {{"asset", {{"version", "2.0"}, {"generator", "test"}}},
            {"extensionsUsed", {"MPC_unknown"}},
            {"scene", 0},
            {"scenes", {{{"nodes", Json::array()}, {"extras", {{"keep", "me"}}}}}}};
    AddNodes(rig);
    AddMesh(rig);
    AddMaterial();
    if (options.old_animation) AddAnimation();
  }

  // The whole file.
  std::string Bytes() {
    json["buffers"] = Json::array({{{"byteLength", binary.size()}}});
    if (options_.data_uri) {
      json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + Base64(binary);
      return json.dump();
    }
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string data = binary;
    data.resize((data.size() + 3) / 4 * 4, '\0');
    return "glTF" + U32(2) + U32(28 + text.size() + data.size()) + U32(text.size()) + "JSON" +
           text + U32(data.size()) + std::string("BIN\0", 4) + data;
  }

  Json json;
  std::string binary;

 private:
  static std::string U32(size_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    return std::string(reinterpret_cast<const char*>(&number), 4);
  }

  static std::string Base64(const std::string& data) {
    const char* const kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (size_t i = 0; i < data.size(); i += 3) {
      unsigned bits = 0;
      for (size_t k = 0; k < 3; ++k) {
        bits = bits << 8 | (i + k < data.size() ? static_cast<unsigned char>(data[i + k]) : 0u);
      }
      for (size_t k = 0; k < 4; ++k) {
        text += i + k <= data.size() ? kDigits[bits >> (18 - 6 * k) & 63] : '=';
      }
    }
    return text;
  }

  int AddView(const void* data, size_t size) {
    binary.resize((binary.size() + 3) / 4 * 4, '\0');
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", size}});
    binary.append(static_cast<const char*>(data), size);
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }

  template <typename Matrix>
  int AddAccessor(const Matrix& values, int component_type, const char* type) {
    json["accessors"].push_back(
        {{"bufferView",
          AddView(values.data(), static_cast<size_t>(values.size()) * sizeof(values(0)))},
         {"componentType", component_type},
         {"count", values.cols()},
         {"type", type}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  static Json ToJson(const Eigen::VectorXd& vector) {
    Json array = Json::array();
    for (const double value : vector) array.push_back(value);
    return array;
  }

  void AddNodes(const RigAsset& rig) {
    const int num_bones = static_cast<int>(rig.bones.size());
    for (int b = 0; b < num_bones; ++b) {
      const RigBone& bone = rig.bones[b];
      Eigen::Affine3d parent = placement_from_armature();
      if (bone.parent >= 0) parent = rig.bones[bone.parent].scene_from_bone;
      Eigen::Affine3d local = parent.inverse() * bone.scene_from_bone;
      if (options_.moved_rest && b > 0) {
        local = local * Eigen::AngleAxisd(0.1 * b, Eigen::Vector3d(1, 2, b).normalized());
      }
      Json node = {{"name", bone.name}};
      if (options_.matrix_nodes) {
        node["matrix"] = ToJson(local.matrix().reshaped());
      } else {
        const double scale = local.linear().col(0).norm();
        node["translation"] = ToJson(local.translation());
        node["rotation"] = ToJson(
            Eigen::Quaterniond(Eigen::Matrix3d(local.linear() / scale)).normalized().coeffs());
        node["scale"] = {scale, scale, scale};
      }
      for (int child = 0; child < num_bones; ++child) {
        if (rig.bones[child].parent == b) node["children"].push_back(child);
      }
      json["nodes"].push_back(node);
    }
    json["nodes"].push_back({{"name", "body"}, {"mesh", 0}, {"skin", 0}, {"extras", {{"a", 1}}}});
    if (options_.armature) {
      const Eigen::Affine3d armature = placement_from_armature();
      Json node = {{"name", "armature"}, {"matrix", ToJson(armature.matrix().reshaped())}};
      node["children"] = {0, num_bones};
      json["nodes"].push_back(node);
      json["scenes"][0]["nodes"] = {num_bones + 1};
    } else {
      json["scenes"][0]["nodes"] = {0, num_bones};
    }
  }

  Eigen::Affine3d placement_from_armature() const {
    Eigen::Affine3d armature = Eigen::Affine3d::Identity();
    if (!options_.armature) return armature;
    return armature * Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitX()) *
           Eigen::Scaling(0.01);
  }

  void AddMesh(const RigAsset& rig) {
    const RigMesh& mesh = rig.meshes[0];
    const Eigen::Affine3d placement = placement_from_armature();
    const Eigen::Index num_vertices = mesh.mesh.positions.cols();
    Eigen::Matrix3Xf positions(3, num_vertices);
    for (Eigen::Index v = 0; v < num_vertices; ++v) {
      const Eigen::Vector3d x = mesh.mesh.positions.col(v).cast<double>();
      positions.col(v) = (placement.inverse() * x).cast<float>();
    }
    Eigen::Matrix4Xf weights = Eigen::Matrix4Xf::Zero(4, num_vertices);
    Eigen::Matrix4Xi joints = Eigen::Matrix4Xi::Zero(4, num_vertices);
    weights.topRows(mesh.weights.rows()) = mesh.weights;
    joints.topRows(mesh.bones.rows()) = mesh.bones;
    if (options_.two_sets) weights /= 2;

    Json attributes;
    attributes["POSITION"] = AddPositions(positions);
    Eigen::Matrix3Xf normals;
    VertexNormals(mesh.mesh.positions, mesh.mesh.triangles, &normals);
    attributes["NORMAL"] = AddAccessor(normals, 5126, "VEC3");
    for (int set = 0; set < (options_.two_sets ? 2 : 1); ++set) {
      const std::string suffix = std::to_string(set);
      if (options_.short_joints) {
        const Eigen::Matrix<std::uint16_t, 4, Eigen::Dynamic> u16 = joints.cast<std::uint16_t>();
        Eigen::Matrix<std::uint16_t, 4, Eigen::Dynamic> w16 =
            (weights * 65535).array().round().matrix().cast<std::uint16_t>();
        attributes["JOINTS_" + suffix] = AddAccessor(u16, 5123, "VEC4");
        attributes["WEIGHTS_" + suffix] = AddAccessor(w16, 5123, "VEC4");
        json["accessors"].back()["normalized"] = true;
      } else {
        const Eigen::Matrix<std::uint8_t, 4, Eigen::Dynamic> u8 = joints.cast<std::uint8_t>();
        attributes["JOINTS_" + suffix] = AddAccessor(u8, 5121, "VEC4");
        attributes["WEIGHTS_" + suffix] = AddAccessor(weights, 5126, "VEC4");
      }
    }
    const Eigen::Matrix<std::uint32_t, 1, Eigen::Dynamic> indices =
        mesh.mesh.triangles.reshaped().transpose().cast<std::uint32_t>();
    json["meshes"] = Json::array({{{"name", mesh.name},
                                   {"primitives",
                                    {{{"attributes", attributes},
                                      {"indices", AddAccessor(indices, 5125, "SCALAR")},
                                      {"material", 0}}}}}});

    Eigen::MatrixXf inverse_bind(16, rig.bones.size());
    Json skin = {{"name", "skin"}, {"extras", {{"kept", true}}}};
    for (size_t b = 0; b < rig.bones.size(); ++b) {
      const Eigen::Affine3d bone_from_mesh = rig.bones[b].scene_from_bone.inverse() * placement;
      inverse_bind.col(b) = bone_from_mesh.matrix().cast<float>().reshaped();
      skin["joints"].push_back(b);
    }
    skin["inverseBindMatrices"] = AddAccessor(inverse_bind, 5126, "MAT4");
    json["skins"] = Json::array({skin});
  }

  int AddPositions(const Eigen::Matrix3Xf& positions) {
    int accessor = 0;
    if (options_.strided) {
      Eigen::Matrix<float, 5, Eigen::Dynamic> padded(5, positions.cols());
      padded << positions, Eigen::Matrix2Xf::Constant(2, positions.cols(), 7);
      accessor = AddAccessor(padded, 5126, "VEC3");
      json["bufferViews"].back()["byteStride"] = 20;
    } else if (options_.sparse) {
      Eigen::Matrix<std::uint16_t, 1, Eigen::Dynamic> indices(1, positions.cols());
      for (Eigen::Index v = 0; v < positions.cols(); ++v) {
        indices(v) = static_cast<std::uint16_t>(v);
      }
      const int index_view = AddView(indices.data(), static_cast<size_t>(indices.size()) * 2);
      const int value_view = AddView(positions.data(), static_cast<size_t>(positions.size()) * 4);
      json["accessors"].push_back(
          {{"componentType", 5126},
           {"count", positions.cols()},
           {"type", "VEC3"},
           {"sparse",
            {{"count", positions.cols()},
             {"indices", {{"bufferView", index_view}, {"componentType", 5123}}},
             {"values", {{"bufferView", value_view}}}}}});
      accessor = static_cast<int>(json["accessors"].size()) - 1;
    } else {
      accessor = AddAccessor(positions, 5126, "VEC3");
    }
    for (int i = 0; i < 3; ++i) {
      json["accessors"][accessor]["min"].push_back(positions.row(i).minCoeff());
      json["accessors"][accessor]["max"].push_back(positions.row(i).maxCoeff());
    }
    return accessor;
  }

  void AddMaterial() {
    const std::string image = "\x89PNG\r\n\x1a\nnot a picture, but kept as it is";
    json["materials"] = Json::array(
        {{{"name", "skin"},
          {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0.1}}},
          {"extensions", {{"MPC_unknown", {{"depth", {1, 2.5}}}}}}}});
    json["samplers"] = Json::array({{{"name", "named sampler"}, {"wrapS", 10497}}});
    json["textures"] = Json::array({{{"sampler", 0}, {"source", 0}}});
    if (options_.data_uri) {
      json["images"] = Json::array({{{"uri", "data:image/png;base64," + Base64(image)}}});
    } else {
      json["images"] = Json::array(
          {{{"mimeType", "image/png"}, {"bufferView", AddView(image.data(), image.size())}}});
    }
  }

  void AddAnimation() {
    const Eigen::RowVectorXf times = Eigen::RowVector2f(0, 1);
    const Eigen::Matrix<float, 3, 2> moves = Eigen::Matrix<float, 3, 2>::Random();
    const int input = AddAccessor(times, 5126, "SCALAR");
    const int output = AddAccessor(moves, 5126, "VEC3");
    json["animations"] = Json::array(
        {{{"name", "old"},
          {"samplers", {{{"input", input}, {"output", output}}}},
          {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}}});
    // Behind it an accessor that is still needed: its index changes when the animation goes.
    const Eigen::Matrix2Xf uv = Eigen::Matrix2Xf::Random(
        2, json["accessors"]
               [json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].get<int>()]["count"]
                   .get<int>());
    const int accessor = AddAccessor(uv, 5126, "VEC2");
    json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = accessor;
  }

  TestGltfOptions options_;
};

inline std::vector<TestGltfOptions> TestGltfVariants() {
  return {{},
          {.armature = true},
          {.matrix_nodes = true},
          {.short_joints = true},
          {.two_sets = true},
          {.sparse = true},
          {.strided = true},
          {.old_animation = true},
          {.data_uri = true},
          {.armature = true, .matrix_nodes = true, .two_sets = true, .old_animation = true}};
}

}  // namespace mpc::testing
