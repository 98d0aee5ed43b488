#include "mpc/io/rig_gltf.h"

#include <cstdint>
#include <cstring>
#include <sstream>

#include "gltf_document.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {

using internal::IsEncodedImage;

namespace {

// A glTF model whose data lies in one buffer.
class ModelBuilder {
 public:
  ModelBuilder() { model_.buffers.resize(1); }

  tinygltf::Model& model() { return model_; }

  int AddNode(const std::string& name) {
    model_.nodes.emplace_back();
    model_.nodes.back().name = name;
    return static_cast<int>(model_.nodes.size()) - 1;
  }

  // One column per element. `target` 0: data that is no vertex attribute.
  template <typename Scalar>
  int AddAccessor(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& values, int type,
                  int component_type, int target) {
    std::vector<unsigned char>& bytes = model_.buffers[0].data;
    bytes.resize((bytes.size() + 3) / 4 * 4);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = bytes.size();
    view.byteLength = static_cast<size_t>(values.size()) * sizeof(Scalar);
    view.target = target;
    bytes.resize(view.byteOffset + view.byteLength);
    std::memcpy(bytes.data() + view.byteOffset, values.data(), view.byteLength);
    model_.bufferViews.push_back(view);

    tinygltf::Accessor accessor;
    accessor.bufferView = static_cast<int>(model_.bufferViews.size()) - 1;
    accessor.componentType = component_type;
    accessor.count = static_cast<size_t>(values.cols());
    accessor.type = type;
    model_.accessors.push_back(accessor);
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  // A picture, as encoded; returns the texture's index.
  int AddTexture(const std::vector<unsigned char>& encoded) {
    std::vector<unsigned char>& bytes = model_.buffers[0].data;
    bytes.resize((bytes.size() + 3) / 4 * 4);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = bytes.size();
    view.byteLength = encoded.size();
    bytes.insert(bytes.end(), encoded.begin(), encoded.end());
    model_.bufferViews.push_back(view);

    tinygltf::Image image;
    image.bufferView = static_cast<int>(model_.bufferViews.size()) - 1;
    image.mimeType = encoded[0] == 0x89 ? "image/png" : "image/jpeg";
    model_.images.push_back(image);
    tinygltf::Texture texture;
    texture.source = static_cast<int>(model_.images.size()) - 1;
    model_.textures.push_back(texture);
    return static_cast<int>(model_.textures.size()) - 1;
  }

  int AddFloats(const Eigen::MatrixXf& values, int type) {
    return AddAccessor<float>(values, type, TINYGLTF_COMPONENT_TYPE_FLOAT,
                              TINYGLTF_TARGET_ARRAY_BUFFER);
  }

 private:
  tinygltf::Model model_;
};

void AddBones(const RigAsset& rig, ModelBuilder* builder) {
  const int armature = builder->AddNode("armature");
  tinygltf::Skin skin;
  skin.skeleton = armature;
  Eigen::MatrixXf inverse_bind(16, rig.bones.size());
  for (size_t b = 0; b < rig.bones.size(); ++b) {
    const RigBone& bone = rig.bones[b];
    skin.joints.push_back(builder->AddNode(bone.name));
    inverse_bind.col(static_cast<Eigen::Index>(b)) =
        bone.scene_from_bone.inverse().matrix().cast<float>().reshaped();
  }
  std::vector<tinygltf::Node>& nodes = builder->model().nodes;
  for (size_t b = 0; b < rig.bones.size(); ++b) {
    const int parent = rig.bones[b].parent;
    nodes[parent < 0 ? armature : skin.joints[parent]].children.push_back(skin.joints[b]);
    Eigen::Affine3d local = rig.bones[b].scene_from_bone;
    if (parent >= 0) local = rig.bones[parent].scene_from_bone.inverse() * local;
    const Eigen::Vector3d scale = local.linear().colwise().norm();
    const Eigen::Quaterniond rotation(
        Eigen::Matrix3d(local.linear() * scale.cwiseInverse().asDiagonal()));
    const Eigen::Vector4d xyzw = rotation.normalized().coeffs();
    tinygltf::Node& node = nodes[skin.joints[b]];
    node.translation.assign(local.translation().begin(), local.translation().end());
    node.rotation.assign(xyzw.begin(), xyzw.end());
    node.scale.assign(scale.begin(), scale.end());
  }
  skin.inverseBindMatrices =
      builder->AddAccessor<float>(inverse_bind, TINYGLTF_TYPE_MAT4, TINYGLTF_COMPONENT_TYPE_FLOAT,
                                  /*target=*/0);
  builder->model().skins.push_back(std::move(skin));
}

// Influences in sets of four, as glTF has them.
void AddInfluences(const RigMesh& mesh, tinygltf::Primitive* primitive, ModelBuilder* builder) {
  const Eigen::Index num_vertices = mesh.mesh.positions.cols();
  for (Eigen::Index begin = 0; begin < mesh.bones.rows(); begin += 4) {
    const Eigen::Index rows = std::min<Eigen::Index>(4, mesh.bones.rows() - begin);
    Eigen::MatrixXf weights = Eigen::MatrixXf::Zero(4, num_vertices);
    weights.topRows(rows) = mesh.weights.middleRows(begin, rows);
    Eigen::Matrix<std::uint16_t, Eigen::Dynamic, Eigen::Dynamic> joints(4, num_vertices);
    joints.setZero();
    joints.topRows(rows) = mesh.bones.middleRows(begin, rows).cast<std::uint16_t>();
    for (Eigen::Index v = 0; v < num_vertices; ++v) {
      for (Eigen::Index k = 0; k < 4; ++k) {
        if (weights(k, v) == 0) joints(k, v) = 0;
      }
    }
    const std::string set = std::to_string(begin / 4);
    primitive->attributes["JOINTS_" + set] = builder->AddAccessor<std::uint16_t>(
        joints, TINYGLTF_TYPE_VEC4, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT,
        TINYGLTF_TARGET_ARRAY_BUFFER);
    primitive->attributes["WEIGHTS_" + set] = builder->AddFloats(weights, TINYGLTF_TYPE_VEC4);
  }
}

// Plain, or with the mesh's texture. Cloth is seen from both sides.
int AddMaterial(const RigMesh& rig_mesh, ModelBuilder* builder) {
  tinygltf::Material material;
  material.name = rig_mesh.name;
  material.doubleSided = true;
  material.pbrMetallicRoughness.metallicFactor = 0;
  if (rig_mesh.texture.empty()) {
    material.pbrMetallicRoughness.baseColorFactor = {0.6, 0.62, 0.65, 1};
  } else {
    material.pbrMetallicRoughness.baseColorTexture.index = builder->AddTexture(rig_mesh.texture);
  }
  builder->model().materials.push_back(std::move(material));
  return static_cast<int>(builder->model().materials.size()) - 1;
}

void CheckTexture(const RigMesh& mesh) {
  if (mesh.texture.empty()) return;
  if (mesh.uv.cols() == 0 || !IsEncodedImage(mesh.texture)) {
    throw Error(ErrorCode::kBadFile, "mesh " + mesh.name +
                                         ": a texture must be a PNG or JPEG file and needs texture "
                                         "coordinates");
  }
}

void AddMesh(const RigMesh& rig_mesh, ModelBuilder* builder) {
  const Eigen::Matrix3Xf& positions = rig_mesh.mesh.positions;
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.material = AddMaterial(rig_mesh, builder);
  const int position = builder->AddFloats(positions, TINYGLTF_TYPE_VEC3);
  for (Eigen::Index i = 0; i < 3; ++i) {
    builder->model().accessors[position].minValues.push_back(positions.row(i).minCoeff());
    builder->model().accessors[position].maxValues.push_back(positions.row(i).maxCoeff());
  }
  primitive.attributes["POSITION"] = position;
  Eigen::Matrix3Xf normals;
  // Smooth over seams of the texture.
  const std::vector<int> welded = WeldedVertices(positions);
  VertexNormals(positions, rig_mesh.mesh.triangles.unaryExpr([&](int v) { return welded[v]; }),
                &normals);
  normals = normals(Eigen::all, welded).eval();
  for (Eigen::Index v = 0; v < normals.cols(); ++v) {
    if (normals.col(v).isZero()) normals.col(v) = Eigen::Vector3f::UnitY();
  }
  primitive.attributes["NORMAL"] = builder->AddFloats(normals, TINYGLTF_TYPE_VEC3);
  if (rig_mesh.uv.cols() == positions.cols()) {
    primitive.attributes["TEXCOORD_0"] = builder->AddFloats(rig_mesh.uv, TINYGLTF_TYPE_VEC2);
  }
  AddInfluences(rig_mesh, &primitive, builder);
  const Eigen::Matrix<std::uint32_t, Eigen::Dynamic, Eigen::Dynamic> indices =
      rig_mesh.mesh.triangles.cast<std::uint32_t>().reshaped(1, rig_mesh.mesh.triangles.size());
  primitive.indices = builder->AddAccessor<std::uint32_t>(indices, TINYGLTF_TYPE_SCALAR,
                                                          TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
                                                          TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);

  tinygltf::Mesh mesh;
  mesh.name = rig_mesh.name;
  mesh.primitives.push_back(std::move(primitive));
  builder->model().meshes.push_back(std::move(mesh));
  const int node = builder->AddNode(rig_mesh.name);
  builder->model().nodes[node].mesh = static_cast<int>(builder->model().meshes.size()) - 1;
  builder->model().nodes[node].skin = 0;
  builder->model().scenes[0].nodes.push_back(node);
}

}  // namespace

void WriteRigGltf(const std::filesystem::path& path, const RigAsset& rig) {
  rig.Validate();
  for (const RigMesh& mesh : rig.meshes) CheckTexture(mesh);
  ModelBuilder builder;
  tinygltf::Model& model = builder.model();
  model.asset.version = "2.0";
  model.asset.generator = "mpc";
  AddBones(rig, &builder);
  model.scenes.emplace_back();
  model.scenes[0].nodes.push_back(0);  // the armature
  model.defaultScene = 0;
  for (const RigMesh& mesh : rig.meshes) AddMesh(mesh, &builder);

  std::ostringstream glb;
  tinygltf::TinyGLTF writer;
  if (!writer.WriteGltfSceneToStream(&model, glb, /*prettyPrint=*/false, /*writeBinary=*/true)) {
    throw Error(ErrorCode::kWriteFailed, path.string() + ": the rig could not be written as glTF");
  }
  WriteFileAtomically(path, glb.str());
}

}  // namespace mpc
