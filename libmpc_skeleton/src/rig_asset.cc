#include "mpc/skeleton/rig_asset.h"

#include <fmt/format.h>

#include <cmath>

#include "mpc/core/error.h"

namespace mpc {
namespace {

// Bone whose chain of parents never ends, or -1.
int FindCycle(const std::vector<RigBone>& bones) {
  enum Mark : char { kNew, kOnPath, kDone };
  std::vector<Mark> marks(bones.size(), kNew);
  std::vector<int> path;
  for (int start = 0; start < static_cast<int>(bones.size()); ++start) {
    path.clear();
    int b = start;
    for (; b >= 0 && marks[b] == kNew; b = bones[b].parent) {
      marks[b] = kOnPath;
      path.push_back(b);
    }
    if (b >= 0 && marks[b] == kOnPath) return b;
    for (const int on_path : path) marks[on_path] = kDone;
  }
  return -1;
}

// First fault of a mesh, or an empty string.
std::string MeshFault(const RigMesh& rig_mesh, int num_bones) {
  const TriangleMesh& mesh = rig_mesh.mesh;
  const Eigen::Index num_vertices = mesh.positions.cols();
  if (num_vertices == 0) return "no vertices";
  if (!mesh.positions.allFinite()) return "a position is not a finite number";
  if (mesh.triangles.size() > 0 &&
      (mesh.triangles.minCoeff() < 0 || mesh.triangles.maxCoeff() >= num_vertices)) {
    return fmt::format("a triangle index is outside its {} vertices", num_vertices);
  }
  if (rig_mesh.bones.rows() != rig_mesh.weights.rows() || rig_mesh.bones.cols() != num_vertices ||
      rig_mesh.weights.cols() != num_vertices || rig_mesh.bones.rows() == 0) {
    return fmt::format("bone indices {}x{} and weights {}x{} for {} vertices",
                       rig_mesh.bones.rows(), rig_mesh.bones.cols(), rig_mesh.weights.rows(),
                       rig_mesh.weights.cols(), num_vertices);
  }
  if (rig_mesh.bones.minCoeff() < 0 || rig_mesh.bones.maxCoeff() >= num_bones) {
    return fmt::format("a bone index is outside the rig's {} bones", num_bones);
  }
  if (!rig_mesh.weights.allFinite()) return "a weight is not a finite number";
  if (rig_mesh.uv.cols() != 0 && rig_mesh.uv.cols() != num_vertices) {
    return fmt::format("{} texture coordinates for {} vertices", rig_mesh.uv.cols(), num_vertices);
  }
  return "";
}

}  // namespace

int RigAsset::num_vertices() const {
  Eigen::Index count = 0;
  for (const RigMesh& mesh : meshes) count += mesh.mesh.positions.cols();
  return static_cast<int>(count);
}

int RigAsset::FindBone(const std::string& name) const {
  for (size_t b = 0; b < bones.size(); ++b) {
    if (bones[b].name == name) return static_cast<int>(b);
  }
  return -1;
}

void RigAsset::Validate() const {
  const int num_bones = static_cast<int>(bones.size());
  std::string faults;
  const auto fault = [&faults](const std::string& text) {
    faults += (faults.empty() ? "" : "; ") + text;
  };
  if (bones.empty()) fault("no bones");
  if (meshes.empty()) fault("no skinned mesh");
  bool parents_ok = true;
  for (int b = 0; b < num_bones; ++b) {
    const RigBone& bone = bones[b];
    if (bone.parent < -1 || bone.parent >= num_bones) {
      parents_ok = false;
      fault(fmt::format("bone {} \"{}\" has parent {} of {} bones", b, bone.name, bone.parent,
                        num_bones));
    }
    if (!bone.scene_from_bone.matrix().allFinite()) {
      fault(fmt::format("bone {} \"{}\" has a bind pose that is not finite", b, bone.name));
    }
  }
  const int cycle = parents_ok ? FindCycle(bones) : -1;
  if (cycle >= 0) {
    fault(fmt::format("bone {} \"{}\" is its own ancestor", cycle, bones[cycle].name));
  }
  for (size_t m = 0; m < meshes.size(); ++m) {
    const std::string mesh_fault = MeshFault(meshes[m], num_bones);
    if (!mesh_fault.empty()) {
      fault(fmt::format("mesh {} \"{}\": {}", m, meshes[m].name, mesh_fault));
    }
  }
  if (!faults.empty()) {
    throw Error(ErrorCode::kBadFile, fmt::format("{}: unusable rig: {}", source, faults));
  }
}

std::vector<std::string> CheckWeights(const RigAsset& rig) {
  constexpr float kSumTolerance = 1e-2f;
  std::vector<std::string> warnings;
  for (const RigMesh& mesh : rig.meshes) {
    int negative = 0;
    int unweighted = 0;
    int unnormalised = 0;
    for (Eigen::Index v = 0; v < mesh.weights.cols(); ++v) {
      const float sum = mesh.weights.col(v).sum();
      if ((mesh.weights.col(v).array() < 0).any()) ++negative;
      if ((mesh.weights.col(v).array() == 0).all()) {
        ++unweighted;
      } else if (!(std::abs(sum - 1) <= kSumTolerance)) {
        ++unnormalised;
      }
    }
    const auto warn = [&](int count, const char* what) {
      if (count == 0) return;
      warnings.push_back(fmt::format("mesh \"{}\": {} of {} vertices {}", mesh.name, count,
                                     mesh.weights.cols(), what));
    };
    warn(negative, "have a negative weight");
    warn(unweighted, "have no weight at all");
    warn(unnormalised, "have weights that do not sum to one");
  }
  return warnings;
}

}  // namespace mpc
