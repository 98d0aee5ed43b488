#include "gltf_proportions.h"

#include <fmt/format.h>

#include <set>
#include <utility>

#include "mpc/core/error.h"

namespace mpc::internal {
namespace {

using Json = nlohmann::ordered_json;

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
                 GltfBinary* binary) {
  Json& attributes = (*primitive)["attributes"];
  const Eigen::Matrix3Xf positions = PositionsInMesh(scene_from_mesh, after);
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
    attributes[attribute] = binary->AddAccessor(vectors.cast<float>(), rows == 3 ? "VEC3" : "VEC4",
                                                TINYGLTF_TARGET_ARRAY_BUFFER, false);
  }
  attributes["POSITION"] =
      binary->AddAccessor(positions, "VEC3", TINYGLTF_TARGET_ARRAY_BUFFER, /*with_bounds=*/true);
}

}  // namespace

bool HasOtherProportions(const RigAsset& original, const RigAsset& rig) {
  constexpr double kSameRig = 1e-9;
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

void RewriteProportions(const GltfDocument& document, const RigAsset& rig, Json* json,
                        GltfBinary* binary, GltfRig* original) {
  RequireOneSkin(document, *original, "its proportions cannot be changed");
  for (size_t m = 0; m < rig.meshes.size(); ++m) {
    const RigMesh& mesh = original->rig.meshes[m];
    RewriteMesh(document, mesh.mesh, rig.meshes[m].mesh,
                original->skin_placement[original->mesh_skin[m]],
                &(*json)["meshes"][mesh.file_mesh]["primitives"][mesh.file_primitive], binary);
  }
  for (size_t s = 0; s < original->skin_bones.size(); ++s) {
    const std::vector<int>& bones = original->skin_bones[s];
    if (bones.empty()) continue;
    Eigen::MatrixXf matrices(16, bones.size());
    for (size_t j = 0; j < bones.size(); ++j) {
      Eigen::Affine3d& bone_from_mesh = original->skin_bone_from_mesh[s][j];
      bone_from_mesh = rig.bones[bones[j]].scene_from_bone.inverse() * original->skin_placement[s];
      matrices.col(j) = bone_from_mesh.matrix().cast<float>().reshaped();
    }
    (*json)["skins"][s]["inverseBindMatrices"] = binary->AddAccessor(matrices, "MAT4", 0, false);
  }
}

void RequireOneSkin(const GltfDocument& document, const GltfRig& original, const char* what) {
  std::set<std::pair<int, int>> primitives;
  for (const RigMesh& mesh : original.rig.meshes) {
    if (primitives.emplace(mesh.file_mesh, mesh.file_primitive).second) continue;
    throw Error(ErrorCode::kUnsupported, fmt::format("{}: mesh {} is used with two skins; {}",
                                                     document.source, mesh.name, what));
  }
}

Eigen::Matrix3Xf PositionsInMesh(const Eigen::Affine3d& scene_from_mesh, const TriangleMesh& mesh) {
  const Eigen::Affine3d mesh_from_scene = scene_from_mesh.inverse();
  Eigen::Matrix3Xf positions(3, mesh.positions.cols());
  for (Eigen::Index v = 0; v < positions.cols(); ++v) {
    const Eigen::Vector3d x = mesh.positions.col(v).cast<double>();
    positions.col(v) = (mesh_from_scene * x).cast<float>();
  }
  return positions;
}

}  // namespace mpc::internal
