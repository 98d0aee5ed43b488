#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <span>

#include "gltf_document.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/gltf.h"

namespace mpc {
namespace {

using internal::GltfDocument;
using internal::GltfRig;
using Json = nlohmann::ordered_json;

constexpr double kMovedM = 2e-6;  // a bone that stays nearer than this keeps its translation
constexpr double kScaleTolerance = 1e-4;
constexpr double kSameRig = 1e-9;

// ---- Checks --------------------------------------------------------------------------------

void CheckPerformance(const RigAsset& rig, const GltfPerformance& performance) {
  const auto fail = [](const std::string& fault) {
    throw Error(ErrorCode::kInvalidArgument, "performance: " + fault);
  };
  const std::vector<double>& times = performance.times_s;
  if (times.empty() || times.size() != performance.scene_from_bone.size()) {
    fail(fmt::format("{} times for {} frames", times.size(), performance.scene_from_bone.size()));
  }
  for (size_t f = 0; f < times.size(); ++f) {
    if (!std::isfinite(times[f]) || times[f] < 0)
      fail(fmt::format("time {} of frame {}", times[f], f));
    if (f > 0 && !(static_cast<float>(times[f]) > static_cast<float>(times[f - 1]))) {
      fail(fmt::format("frame {} at {} s does not follow frame {} at {} s", f, times[f], f - 1,
                       times[f - 1]));
    }
    if (performance.scene_from_bone[f].size() != rig.bones.size()) {
      fail(fmt::format("frame {} has {} bones, the rig has {}", f,
                       performance.scene_from_bone[f].size(), rig.bones.size()));
    }
    for (const Eigen::Affine3d& bone : performance.scene_from_bone[f]) {
      if (!bone.matrix().allFinite() || !(bone.linear().determinant() > 0)) {
        fail(fmt::format("frame {} has a bone transform that is singular or not finite", f));
      }
    }
  }
  if (performance.camera) performance.camera->Validate();
  const size_t num_places = performance.scene_from_camera.size();
  if (performance.camera && num_places != 1 && num_places != times.size()) {
    fail(fmt::format("{} places of the camera for {} frames", num_places, times.size()));
  }
  for (const Eigen::Isometry3d& place : performance.scene_from_camera) {
    if (!place.matrix().allFinite()) fail("the camera's place is not finite");
  }
}

void CheckSameSource(const GltfDocument& document, const RigAsset& original, const RigAsset& rig) {
  const auto fail = [&](const std::string& fault) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{} is not the source of this rig: {}", document.source, fault));
  };
  if (rig.bones.size() != original.bones.size() || rig.meshes.size() != original.meshes.size()) {
    fail(fmt::format("{} bones and {} meshes, the rig has {} and {}", original.bones.size(),
                     original.meshes.size(), rig.bones.size(), rig.meshes.size()));
  }
  for (size_t b = 0; b < rig.bones.size(); ++b) {
    if (rig.bones[b].node != original.bones[b].node) fail(fmt::format("bone {} differs", b));
  }
  for (size_t m = 0; m < rig.meshes.size(); ++m) {
    const Eigen::Index found = original.meshes[m].mesh.positions.cols();
    if (rig.meshes[m].mesh.positions.cols() != found) {
      fail(fmt::format("mesh {} has {} vertices, the rig's has {}", m, found,
                       rig.meshes[m].mesh.positions.cols()));
    }
  }
}

bool HasOtherProportions(const RigAsset& original, const RigAsset& rig) {
  for (size_t b = 0; b < rig.bones.size(); ++b) {
    if (!rig.bones[b].scene_from_bone.isApprox(original.bones[b].scene_from_bone, kSameRig)) {
      return true;
    }
  }
  for (size_t m = 0; m < rig.meshes.size(); ++m) {
    if (rig.meshes[m].mesh.positions != original.meshes[m].mesh.positions) return true;
  }
  return false;
}

// ---- Data ----------------------------------------------------------------------------------

// The one binary buffer of the file being written, and the JSON lists that point into it.
class BinaryChunk {
 public:
  // Makes both lists now: adding a member later would move the others in memory.
  explicit BinaryChunk(Json* json) : json_(json) {
    for (const char* list : {"accessors", "bufferViews"}) {
      if (!json->contains(list)) (*json)[list] = Json::array();
    }
  }

  const std::string& bytes() const { return bytes_; }

  // Moves a view's content into this buffer.
  void Adopt(Json* view, std::span<const unsigned char> data) {
    (*view)["buffer"] = 0;
    (*view)["byteOffset"] = Append(data.data(), data.size());
    (*view)["byteLength"] = data.size();
  }

  int AddView(std::span<const unsigned char> data, int target = 0) {
    Json view = {{"buffer", 0},
                 {"byteOffset", Append(data.data(), data.size())},
                 {"byteLength", data.size()}};
    if (target != 0) view["target"] = target;
    (*json_)["bufferViews"].push_back(std::move(view));
    return static_cast<int>((*json_)["bufferViews"].size()) - 1;
  }

  // One column per element.
  int AddAccessor(const Eigen::MatrixXf& values, const char* type, int target, bool with_bounds) {
    const auto* data = reinterpret_cast<const unsigned char*>(values.data());
    const auto size = static_cast<size_t>(values.size()) * sizeof(float);
    Json accessor = {{"bufferView", AddView({data, size}, target)},
                     {"componentType", TINYGLTF_COMPONENT_TYPE_FLOAT},
                     {"count", values.cols()},
                     {"type", type}};
    if (with_bounds) {
      for (Eigen::Index i = 0; i < values.rows(); ++i) {
        accessor["min"].push_back(values.row(i).minCoeff());
        accessor["max"].push_back(values.row(i).maxCoeff());
      }
    }
    (*json_)["accessors"].push_back(std::move(accessor));
    return static_cast<int>((*json_)["accessors"].size()) - 1;
  }

 private:
  size_t Append(const unsigned char* data, size_t size) {
    bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0');
    const size_t offset = bytes_.size();
    bytes_.append(reinterpret_cast<const char*>(data), size);
    return offset;
  }

  Json* json_;
  std::string bytes_;
};

// Every reference of the JSON to an accessor, animations left out.
template <typename Visit>
void ForEachAccessorReference(Json* json, const Visit& visit) {
  const auto visit_all = [&](Json& attributes) {
    for (Json& accessor : attributes) visit(accessor);
  };
  if (json->contains("meshes")) {
    for (Json& mesh : (*json)["meshes"]) {
      for (Json& primitive : mesh["primitives"]) {
        visit_all(primitive["attributes"]);
        if (primitive.contains("indices")) visit(primitive["indices"]);
        if (!primitive.contains("targets")) continue;
        for (Json& target : primitive["targets"]) visit_all(target);
      }
    }
  }
  if (json->contains("skins")) {
    for (Json& skin : (*json)["skins"]) {
      if (skin.contains("inverseBindMatrices")) visit(skin["inverseBindMatrices"]);
    }
  }
}

template <typename Visit>
void ForEachViewReference(Json* json, const Visit& visit) {
  if (json->contains("accessors")) {
    for (Json& accessor : (*json)["accessors"]) {
      if (accessor.contains("bufferView")) visit(accessor["bufferView"]);
      if (!accessor.contains("sparse")) continue;
      visit(accessor["sparse"]["indices"]["bufferView"]);
      visit(accessor["sparse"]["values"]["bufferView"]);
    }
  }
  if (json->contains("images")) {
    for (Json& image : (*json)["images"]) {
      if (image.contains("bufferView")) visit(image["bufferView"]);
    }
  }
}

// Removes from `list` the entries of `candidates` that nothing refers to, and renumbers the
// references that for_each visits.
template <typename ForEach>
void RemoveUnused(Json* list, std::set<int> candidates, const ForEach& for_each) {
  for_each([&](Json& index) { candidates.erase(index.get<int>()); });
  for_each([&](Json& index) {
    const int old_index = index.get<int>();
    index = old_index -
            static_cast<int>(std::distance(candidates.begin(), candidates.lower_bound(old_index)));
  });
  for (auto it = candidates.rbegin(); it != candidates.rend(); ++it) {
    list->erase(static_cast<size_t>(*it));
  }
}

std::set<int> AnimationAccessors(const Json& json) {
  std::set<int> accessors;
  for (const Json& animation : json.at("animations")) {
    for (const Json& sampler : animation.at("samplers")) {
      accessors.insert({sampler.at("input").get<int>(), sampler.at("output").get<int>()});
    }
  }
  return accessors;
}

// Drops the animations and the data that only they used. Extensions named EXT_ may refer to
// accessors in ways unknown here: then the data stays, and only the animations go.
void DropAnimations(const GltfDocument& document, Json* json) {
  if (!json->contains("animations")) return;
  const std::set<int> accessors = AnimationAccessors(*json);
  json->erase("animations");
  for (const std::string& extension : document.model.extensionsUsed) {
    if (extension.starts_with("EXT_")) return;
  }
  std::set<int> views;
  for (const int accessor : accessors) {
    if (accessor < 0 || accessor >= static_cast<int>(document.model.accessors.size())) return;
    const int view = document.model.accessors[accessor].bufferView;
    if (view >= 0) views.insert(view);
  }
  RemoveUnused(&(*json)["accessors"], accessors,
               [&](const auto& visit) { ForEachAccessorReference(json, visit); });
  RemoveUnused(&(*json)["bufferViews"], views,
               [&](const auto& visit) { ForEachViewReference(json, visit); });
}

std::string MimeType(std::span<const unsigned char> image) {
  const auto starts_with = [&](std::string_view magic) {
    return image.size() >= magic.size() &&
           std::memcmp(image.data(), magic.data(), magic.size()) == 0;
  };
  if (starts_with("\x89PNG")) return "image/png";
  if (starts_with("RIFF")) return "image/webp";
  if (starts_with("\xABKTX")) return "image/ktx2";
  return "image/jpeg";
}

// Gathers all buffers and all images that lay beside the file into the one buffer of a .glb.
void GatherData(const GltfDocument& document, Json* json, BinaryChunk* chunk) {
  if (json->contains("bufferViews")) {
    for (Json& view : (*json)["bufferViews"]) {
      const auto& buffer = document.model.buffers[view["buffer"].get<size_t>()].data;
      const auto offset = view.value("byteOffset", size_t{0});
      const auto length = view["byteLength"].get<size_t>();
      if (offset > buffer.size() || length > buffer.size() - offset) {
        document.Fail("a buffer view lies outside of its buffer");
      }
      chunk->Adopt(&view, std::span(buffer).subspan(offset, length));
    }
  }
  for (size_t i = 0; i < document.model.images.size(); ++i) {
    const std::vector<unsigned char>& bytes = document.model.images[i].image;
    if (bytes.empty()) continue;
    Json& image = (*json)["images"][i];
    image.erase("uri");
    image["mimeType"] = MimeType(bytes);
    image["bufferView"] = chunk->AddView(bytes);
  }
}

// ---- Nodes ---------------------------------------------------------------------------------

struct Trs {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();

  Eigen::Affine3d Transform() const {
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
    transform.linear() = rotation.toRotationMatrix() * scale.asDiagonal();
    transform.translation() = translation;
    return transform;
  }
};

// The rotation and scale nearest to a transform; exact without shear.
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

// Parents before children.
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

// The bone at a node, or -1.
std::vector<int> BoneOfNode(const GltfDocument& document, const RigAsset& rig) {
  std::vector<int> bone_of_node(document.parent.size(), -1);
  for (size_t b = 0; b < rig.bones.size(); ++b) {
    bone_of_node[rig.bones[b].node] = static_cast<int>(b);
  }
  return bone_of_node;
}

template <typename Vector>
Json ToJson(const Vector& vector) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) json.push_back(vector[i]);
  return json;
}

// Rest transforms of the bones' nodes: the source's own, or `rig`'s bind pose when it has other
// proportions. Animated nodes must have translation, rotation and scale instead of a matrix.
std::vector<Trs> WriteRestPose(const GltfDocument& document, const RigAsset& rig,
                               bool other_proportions, Json* json) {
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
    Json& node = (*json)["nodes"][n];
    if (!other_proportions && !node.contains("matrix")) continue;
    node.erase("matrix");
    node["translation"] = ToJson(rest[bone].translation);
    node["rotation"] = ToJson(rest[bone].rotation.coeffs());
    node["scale"] = ToJson(rest[bone].scale);
  }
  return rest;
}

// ---- Animation -----------------------------------------------------------------------------

class AnimationWriter {
 public:
  AnimationWriter(BinaryChunk* chunk, const std::vector<double>& times_s) : chunk_(chunk) {
    Eigen::MatrixXf times(1, times_s.size());
    for (size_t f = 0; f < times_s.size(); ++f) times(0, f) = static_cast<float>(times_s[f]);
    input_ = chunk_->AddAccessor(times, "SCALAR", 0, /*with_bounds=*/true);
  }

  void AddChannel(int node, const char* path, const Eigen::MatrixXf& values) {
    const int output = chunk_->AddAccessor(values, values.rows() == 4 ? "VEC4" : "VEC3", 0, false);
    channels_.push_back(
        {{"sampler", samplers_.size()}, {"target", {{"node", node}, {"path", path}}}});
    samplers_.push_back({{"input", input_}, {"interpolation", "LINEAR"}, {"output", output}});
  }

  Json Finish() const {
    return {{"name", "performance"}, {"channels", channels_}, {"samplers", samplers_}};
  }

 private:
  BinaryChunk* chunk_;
  int input_ = 0;
  Json channels_ = Json::array();
  Json samplers_ = Json::array();
};

// Keys of one bone relative to where its parent will really be shown, frame by frame. A viewer's
// transforms come back in `world`, so that no rounding is handed down the chain.
void AnimateBone(int node, bool is_root, const Trs& rest,
                 const std::vector<Eigen::Affine3d>& parent_world,
                 const std::vector<const Eigen::Affine3d*>& target, AnimationWriter* animation,
                 std::vector<Eigen::Affine3d>* world) {
  const auto num_frames = static_cast<Eigen::Index>(target.size());
  Eigen::MatrixXf rotations(4, num_frames);
  Eigen::MatrixXf translations(3, num_frames);
  Eigen::MatrixXf scales(3, num_frames);
  bool moves = is_root;
  bool scales_change = false;
  Eigen::Quaterniond previous = rest.rotation;
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    const Eigen::Affine3d& parent = parent_world[f];
    Trs local = Decompose(parent.inverse() * *target[f]);
    if (local.rotation.dot(previous) < 0) local.rotation.coeffs() *= -1;
    previous = local.rotation;
    rotations.col(f) = local.rotation.coeffs().cast<float>();
    translations.col(f) = local.translation.cast<float>();
    scales.col(f) = local.scale.cast<float>();
    moves |= (parent.linear() * (local.translation - rest.translation)).norm() > kMovedM;
    scales_change |= ((local.scale.array() / rest.scale.array() - 1).abs() > kScaleTolerance).any();
  }
  animation->AddChannel(node, "rotation", rotations);
  if (moves) animation->AddChannel(node, "translation", translations);
  if (scales_change) animation->AddChannel(node, "scale", scales);

  for (Eigen::Index f = 0; f < num_frames; ++f) {
    Trs shown = rest;
    shown.rotation =
        Eigen::Quaternionf(Eigen::Vector4f(rotations.col(f))).cast<double>().normalized();
    if (moves) shown.translation = translations.col(f).cast<double>();
    if (scales_change) shown.scale = scales.col(f).cast<double>();
    (*world)[f] = parent_world[f] * shown.Transform();
  }
}

void AnimateBones(const GltfDocument& document, const RigAsset& rig, const std::vector<Trs>& rest,
                  const GltfPerformance& performance, AnimationWriter* animation) {
  const size_t num_frames = performance.times_s.size();
  const std::vector<int> bone_of_node = BoneOfNode(document, rig);
  const std::vector<Eigen::Affine3d> scene(num_frames, Eigen::Affine3d::Identity());
  std::vector<std::vector<Eigen::Affine3d>> world(document.parent.size());  // per node and frame
  for (const int n : NodesInOrder(document)) {
    const std::vector<Eigen::Affine3d>& parent =
        document.parent[n] < 0 ? scene : world[document.parent[n]];
    world[n].resize(num_frames);
    const int bone = bone_of_node[n];
    if (bone < 0) {
      const Eigen::Affine3d local = document.LocalTransform(n);
      for (size_t f = 0; f < num_frames; ++f) world[n][f] = parent[f] * local;
      continue;
    }
    std::vector<const Eigen::Affine3d*> target;
    for (const auto& frame : performance.scene_from_bone) target.push_back(&frame[bone]);
    AnimateBone(n, rig.bones[bone].parent < 0, rest[bone], parent, target, animation, &world[n]);
  }
}

// ---- Other proportions ---------------------------------------------------------------------

// Area-weighted normals that do not break at UV seams.
Eigen::Matrix3Xf SmoothNormals(const TriangleMesh& mesh, const std::vector<int>& welded) {
  Triangles triangles = mesh.triangles;
  for (int& v : triangles.reshaped()) v = welded[v];
  Eigen::Matrix3Xf at_welded;
  VertexNormals(mesh.positions, triangles, &at_welded);
  Eigen::Matrix3Xf normals(3, mesh.positions.cols());
  for (Eigen::Index v = 0; v < normals.cols(); ++v) normals.col(v) = at_welded.col(welded[v]);
  return normals;
}

// Rewrites positions, and turns normals and tangents as the smooth surface turned: hard edges and
// seams stay as modelled.
void RewriteMesh(const GltfDocument& document, const TriangleMesh& before,
                 const TriangleMesh& after, const Eigen::Affine3d& scene_from_mesh, Json* primitive,
                 BinaryChunk* chunk) {
  Json& attributes = (*primitive)["attributes"];
  const Eigen::Affine3d mesh_from_scene = scene_from_mesh.inverse();
  Eigen::MatrixXf positions(3, after.positions.cols());
  for (Eigen::Index v = 0; v < positions.cols(); ++v) {
    const Eigen::Vector3d x = after.positions.col(v).cast<double>();
    positions.col(v) = (mesh_from_scene * x).cast<float>();
  }
  const std::vector<int> welded = WeldedVertices(before.positions);
  const Eigen::Matrix3Xf normals_before = SmoothNormals(before, welded);
  const Eigen::Matrix3Xf normals_after = SmoothNormals(after, welded);
  const Eigen::Matrix3d placement = scene_from_mesh.rotation();
  for (const auto& [attribute, rows] : {std::pair("NORMAL", 3), std::pair("TANGENT", 4)}) {
    if (!attributes.contains(attribute)) continue;
    Eigen::MatrixXd vectors =
        document.ReadAccessor(attributes[attribute].get<int>(), rows, attribute);
    if (vectors.cols() != positions.cols()) document.Fail("normals and positions differ in number");
    for (Eigen::Index v = 0; v < vectors.cols(); ++v) {
      const Eigen::Vector3d from = normals_before.col(v).cast<double>();
      const Eigen::Vector3d to = normals_after.col(v).cast<double>();
      if (from.isZero() || to.isZero()) continue;
      const Eigen::Vector3d turned =
          placement.transpose() *
          (Eigen::Quaterniond::FromTwoVectors(from, to) * (placement * vectors.col(v).head<3>()));
      vectors.col(v).head<3>() = turned.normalized();
    }
    attributes[attribute] = chunk->AddAccessor(vectors.cast<float>(), rows == 3 ? "VEC3" : "VEC4",
                                               TINYGLTF_TARGET_ARRAY_BUFFER, false);
  }
  attributes["POSITION"] =
      chunk->AddAccessor(positions, "VEC3", TINYGLTF_TARGET_ARRAY_BUFFER, /*with_bounds=*/true);
}

// Each mesh stays in its own frame; the new inverse bind matrices lead from there to the new bones.
void RewriteProportions(const GltfDocument& document, const GltfRig& original, const RigAsset& rig,
                        Json* json, BinaryChunk* chunk) {
  std::map<std::pair<int, int>, int> skin_of_primitive;
  for (size_t m = 0; m < rig.meshes.size(); ++m) {
    const RigMesh& mesh = original.rig.meshes[m];
    const int skin = original.mesh_skin[m];
    if (!skin_of_primitive.emplace(std::pair(mesh.file_mesh, mesh.file_primitive), skin).second) {
      throw Error(
          ErrorCode::kUnsupported,
          fmt::format("{}: mesh {} is used with two skins; its proportions cannot be changed",
                      document.source, mesh.name));
    }
    RewriteMesh(document, mesh.mesh, rig.meshes[m].mesh, original.skin_placement[skin],
                &(*json)["meshes"][mesh.file_mesh]["primitives"][mesh.file_primitive], chunk);
  }
  for (size_t s = 0; s < original.skin_bones.size(); ++s) {
    const std::vector<int>& bones = original.skin_bones[s];
    if (bones.empty()) continue;
    Eigen::MatrixXf matrices(16, bones.size());
    for (size_t j = 0; j < bones.size(); ++j) {
      const Eigen::Affine3d bone_from_mesh =
          rig.bones[bones[j]].scene_from_bone.inverse() * original.skin_placement[s];
      matrices.col(j) = bone_from_mesh.matrix().cast<float>().reshaped();
    }
    (*json)["skins"][s]["inverseBindMatrices"] = chunk->AddAccessor(matrices, "MAT4", 0, false);
  }
}

// ---- Camera and container ------------------------------------------------------------------

// A file without scenes shows nothing by the letter; viewers show its root nodes.
Json* DefaultScene(const GltfDocument& document, Json* json) {
  if (!document.model.scenes.empty()) {
    return &(*json)["scenes"][static_cast<size_t>(std::max(document.model.defaultScene, 0))];
  }
  Json scene;
  for (size_t n = 0; n < document.parent.size(); ++n) {
    if (document.parent[n] < 0) scene["nodes"].push_back(n);
  }
  (*json)["scenes"] = Json::array({std::move(scene)});
  (*json)["scene"] = 0;
  return &(*json)["scenes"][0];
}

// glTF cameras look along -z with y up.
Eigen::Quaterniond GltfCameraRotation(const Eigen::Isometry3d& scene_from_camera) {
  const Eigen::Matrix3d rotation =
      scene_from_camera.linear() * Eigen::Vector3d(1, -1, -1).asDiagonal();
  return Eigen::Quaterniond(rotation).normalized();
}

// Returns the camera's node.
int WriteCamera(const GltfDocument& document, const Camera& camera,
                const Eigen::Isometry3d& scene_from_camera, Json* json) {
  constexpr double kNear = 0.01;  // m
  const std::string name = camera.name.empty() ? "camera" : camera.name;
  (*json)["cameras"].push_back(
      {{"name", name},
       {"type", "perspective"},
       {"perspective",
        {{"yfov", 2 * std::atan(camera.height / (2 * camera.fy))},
         {"aspectRatio", camera.width * camera.fy / (camera.height * camera.fx)},
         {"znear", kNear}}}});
  const Eigen::Vector3d translation = scene_from_camera.translation();
  (*json)["nodes"].push_back({{"name", name},
                              {"camera", (*json)["cameras"].size() - 1},
                              {"translation", ToJson(translation)},
                              {"rotation", ToJson(GltfCameraRotation(scene_from_camera).coeffs())},
                              {"extras",
                               {{"mpc_camera",
                                 {{"width", camera.width},
                                  {"height", camera.height},
                                  {"fx", camera.fx},
                                  {"fy", camera.fy},
                                  {"cx", camera.cx},
                                  {"cy", camera.cy},
                                  {"dist", camera.distortion}}}}}});
  const int node = static_cast<int>((*json)["nodes"].size()) - 1;
  (*DefaultScene(document, json))["nodes"].push_back(node);
  return node;
}

void AnimateCamera(int node, const std::vector<Eigen::Isometry3d>& scene_from_camera,
                   AnimationWriter* animation) {
  const auto num_frames = static_cast<Eigen::Index>(scene_from_camera.size());
  Eigen::MatrixXf rotations(4, num_frames);
  Eigen::MatrixXf translations(3, num_frames);
  Eigen::Quaterniond previous = GltfCameraRotation(scene_from_camera.front());
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    Eigen::Quaterniond rotation = GltfCameraRotation(scene_from_camera[f]);
    if (rotation.dot(previous) < 0) rotation.coeffs() *= -1;
    previous = rotation;
    rotations.col(f) = rotation.coeffs().cast<float>();
    translations.col(f) = scene_from_camera[f].translation().cast<float>();
  }
  animation->AddChannel(node, "rotation", rotations);
  animation->AddChannel(node, "translation", translations);
}

std::string Glb(const Json& json, std::string binary) {
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4, '\0');
  std::string glb;
  const auto append_number = [&](size_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    glb.append(reinterpret_cast<const char*>(&number), sizeof(number));
  };
  glb += "glTF";
  append_number(2);
  append_number(12 + 8 + text.size() + 8 + binary.size());
  append_number(text.size());
  glb += "JSON" + text;
  append_number(binary.size());
  glb += std::string("BIN\0", 4) + binary;
  return glb;
}

}  // namespace

void WriteGltfPerformance(const std::filesystem::path& path, const std::filesystem::path& source,
                          const RigAsset& rig, const GltfPerformance& performance) {
  CheckPerformance(rig, performance);
  const GltfDocument document = internal::LoadGltf(source);
  const GltfRig original = internal::BuildRig(document);
  CheckSameSource(document, original.rig, rig);
  const bool other_proportions = HasOtherProportions(original.rig, rig);

  std::string glb;
  try {
    Json json = document.json;
    BinaryChunk chunk(&json);
    DropAnimations(document, &json);
    GatherData(document, &json, &chunk);
    if (other_proportions) RewriteProportions(document, original, rig, &json, &chunk);
    const std::vector<Trs> rest = WriteRestPose(document, rig, other_proportions, &json);
    AnimationWriter animation(&chunk, performance.times_s);
    AnimateBones(document, rig, rest, performance, &animation);
    if (performance.camera) {
      const std::vector<Eigen::Isometry3d>& places = performance.scene_from_camera;
      const int node = WriteCamera(document, *performance.camera, places.front(), &json);
      if (places.size() > 1) AnimateCamera(node, places, &animation);
    }
    json["animations"] = Json::array({animation.Finish()});
    json["buffers"] = Json::array({{{"byteLength", chunk.bytes().size()}}});
    glb = Glb(json, chunk.bytes());
  } catch (const Json::exception& e) {
    document.Fail(fmt::format("not a valid glTF file: {}", e.what()));
  }
  WriteFileAtomically(path, glb);
}

}  // namespace mpc
