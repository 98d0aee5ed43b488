#include "gltf_surface.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "gltf_proportions.h"
#include "mpc/io/pc2.h"

namespace mpc::internal {
namespace {

using Json = nlohmann::ordered_json;
using Matrix34 = Eigen::Matrix<double, 3, 4>;

constexpr double kUnmovedM = 1e-5;   // a vertex that skinning brings so near needs no offset
constexpr double kCollapsed = 0.02;  // of the largest singular value: nothing can be moved along it
constexpr double kMinWeight = 1e-6;  // of all influences together

// One primitive of the rig.
struct Part {
  const RigMesh& mesh;
  int skin = 0;
  Eigen::Index begin = 0;    // of its vertices among all
  Eigen::Matrix3Xd at_bind;  // positions in the mesh's own frame
};

std::vector<Part> MakeParts(const GltfDocument& document, const GltfRig& original,
                            const RigAsset& rig, bool other_proportions) {
  std::vector<Part> parts;
  Eigen::Index begin = 0;
  for (size_t m = 0; m < rig.meshes.size(); ++m) {
    const RigMesh& mesh = rig.meshes[m];
    const int skin = original.mesh_skin[m];
    const RigMesh& in_file = original.rig.meshes[m];
    const auto& attributes =
        document.model.meshes[in_file.file_mesh].primitives[in_file.file_primitive].attributes;
    Eigen::Matrix3Xd at_bind =
        other_proportions
            ? PositionsInMesh(original.skin_placement[skin], mesh.mesh).cast<double>().eval()
            : Eigen::Matrix3Xd(document.ReadAccessor(attributes.at("POSITION"), 3, "positions"));
    parts.push_back({mesh, skin, begin, std::move(at_bind)});
    begin += mesh.mesh.positions.cols();
  }
  return parts;
}

Eigen::Vector3d Apply(const Matrix34& transform, const Eigen::Vector3d& x) {
  return transform.leftCols<3>() * x + transform.col(3);
}

// The smallest change with matrix * change = difference, or as near as the matrix allows.
Eigen::Vector3d SolveNearest(const Eigen::Matrix3d& matrix, const Eigen::Vector3d& difference) {
  const double size = matrix.norm();
  if (std::abs(matrix.determinant()) > kCollapsed * size * size * size) {
    return matrix.inverse() * difference;
  }
  Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  svd.setThreshold(kCollapsed);
  return svd.solve(difference);
}

// One frame of the surface, and how the file's bones skin each vertex in it.
class Frame {
 public:
  Frame(const std::vector<Part>& parts, const GltfRig& original,
        const std::vector<std::vector<Eigen::Affine3d>>& shown)
      : parts_(parts), original_(original), shown_(shown) {}

  void Read(int frame, Pc2Reader* surface) {
    surface->Read(frame, &surface_);
    scene_from_mesh_.resize(static_cast<size_t>(surface_.cols()));
    for (const Part& part : parts_) Skin(static_cast<size_t>(frame), part);
  }

  // What brings every vertex from bind to the surface, 3xV.
  void Offsets(Eigen::Matrix3Xf* offsets) const {
    offsets->setZero(3, surface_.cols());
    ForEachVertex([&](Eigen::Index v, const Eigen::Vector3d& at_bind, const Matrix34& skinning) {
      const Eigen::Vector3d target = surface_.col(v).cast<double>();
      const Eigen::Vector3d difference = target - Apply(skinning, at_bind);
      if (difference.norm() <= kUnmovedM) return;
      offsets->col(v) = SolveNearest(skinning.leftCols<3>(), difference).cast<float>();
    });
  }

  // Adds up how far the vertices are from the surface with these offsets.
  void Measure(const Eigen::Matrix3Xf& offsets, double* sum, std::int64_t* count,
               double* max) const {
    ForEachVertex([&](Eigen::Index v, const Eigen::Vector3d& at_bind, const Matrix34& skinning) {
      const Eigen::Vector3d morphed = at_bind + offsets.col(v).cast<double>();
      const Eigen::Vector3d target = surface_.col(v).cast<double>();
      const double distance = (Apply(skinning, morphed) - target).norm();
      *sum += distance;
      ++*count;
      *max = std::max(*max, distance);
    });
  }

 private:
  void Skin(size_t frame, const Part& part) {
    const std::vector<int>& bones = original_.skin_bones[part.skin];
    std::vector<Matrix34> of_bone(shown_.size(), Matrix34::Zero());
    for (size_t j = 0; j < bones.size(); ++j) {
      of_bone[bones[j]] = (shown_[bones[j]][frame] * original_.skin_bone_from_mesh[part.skin][j])
                              .matrix()
                              .topRows<3>();
    }
    const RigMesh& mesh = part.mesh;
    for (Eigen::Index v = 0; v < mesh.weights.cols(); ++v) {
      Matrix34& skinning = scene_from_mesh_[part.begin + v];
      skinning.setZero();
      const double sum = mesh.weights.col(v).cast<double>().sum();
      if (!(sum > kMinWeight)) continue;
      for (Eigen::Index k = 0; k < mesh.weights.rows(); ++k) {
        if (mesh.weights(k, v) != 0)
          skinning += mesh.weights(k, v) / sum * of_bone[mesh.bones(k, v)];
      }
    }
  }

  // Vertices that no bone moves are left out.
  template <typename Visit>
  void ForEachVertex(const Visit& visit) const {
    for (const Part& part : parts_) {
      for (Eigen::Index v = 0; v < part.at_bind.cols(); ++v) {
        const Matrix34& skinning = scene_from_mesh_[part.begin + v];
        if (!skinning.isZero(0)) visit(part.begin + v, part.at_bind.col(v), skinning);
      }
    }
  }

  const std::vector<Part>& parts_;
  const GltfRig& original_;
  const std::vector<std::vector<Eigen::Affine3d>>& shown_;
  Eigen::Matrix3Xf surface_;
  std::vector<Matrix34> scene_from_mesh_;  // per vertex
};

// The targets of all primitives of the meshes that the rig is made of.
class TargetWriter {
 public:
  TargetWriter(const GltfDocument& document, const std::vector<Part>& parts, Json* json,
               GltfBinary* binary)
      : document_(document), parts_(parts), json_(json), binary_(binary) {
    for (const Part& part : parts) {
      meshes_.insert(part.mesh.file_mesh);
      in_rig_.emplace(part.mesh.file_mesh, part.mesh.file_primitive);
    }
  }

  const std::set<int>& meshes() const { return meshes_; }

  // Targets that the mesh had before.
  int NumOwn(int mesh) const {
    return static_cast<int>(document_.model.meshes[mesh].primitives[0].targets.size());
  }

  void Add(const Eigen::Matrix3Xf& offsets) {
    for (const Part& part : parts_) {
      const Eigen::Matrix3Xf own = offsets.middleCols(part.begin, part.at_bind.cols());
      AddTo(part.mesh.file_mesh, static_cast<size_t>(part.mesh.file_primitive),
            binary_->AddMostlyZero(own));
    }
  }

  // Every primitive of a mesh has as many targets as the others; names and resting weights too.
  void Finish(const std::vector<int>& frames) {
    for (const int m : meshes_) {
      const auto& primitives = document_.model.meshes[m].primitives;
      for (size_t p = 0; p < primitives.size(); ++p) {
        if (static_cast<int>(primitives[p].targets.size()) != NumOwn(m)) {
          document_.Fail(
              fmt::format("mesh {} has primitives with different numbers of targets", m));
        }
        if (!in_rig_.contains({m, static_cast<int>(p)})) AddUnmoved(m, p, frames.size());
      }
      const size_t num_targets = static_cast<size_t>(NumOwn(m)) + frames.size();
      Extend(&(*json_)["meshes"][m], num_targets);
      for (Json& node : (*json_)["nodes"]) {
        if (node.value("mesh", -1) == m) Extend(&node, num_targets);
      }
      Name(m, frames);
    }
  }

 private:
  void AddTo(int mesh, size_t primitive, int accessor) {
    (*json_)["meshes"][mesh]["primitives"][primitive]["targets"].push_back(
        {{"POSITION", accessor}});
  }

  void AddUnmoved(int mesh, size_t primitive, size_t num_targets) {
    const auto& attributes = document_.model.meshes[mesh].primitives[primitive].attributes;
    const auto position = attributes.find("POSITION");
    if (position == attributes.end()) document_.Fail(fmt::format("mesh {} has no positions", mesh));
    const Eigen::Index count = document_.ReadAccessor(position->second, 3, "positions").cols();
    const int accessor = binary_->AddMostlyZero(Eigen::Matrix3Xf::Zero(3, count));
    for (size_t t = 0; t < num_targets; ++t) AddTo(mesh, primitive, accessor);
  }

  // Resting weights must be as many as the targets.
  static void Extend(Json* owner, size_t num_targets) {
    if (!owner->contains("weights")) return;
    while ((*owner)["weights"].size() < num_targets) (*owner)["weights"].push_back(0);
  }

  void Name(int m, const std::vector<int>& frames) {
    Json& mesh = (*json_)["meshes"][m];
    if (!mesh.contains("extras")) mesh["extras"] = Json::object();
    if (!mesh["extras"].is_object()) return;
    Json names = mesh["extras"].value("targetNames", Json::array());
    if (!names.is_array() || static_cast<int>(names.size()) != NumOwn(m)) return;
    for (const int frame : frames) names.push_back(fmt::format("frame_{:06}", frame));
    mesh["extras"]["targetNames"] = std::move(names);
  }

  const GltfDocument& document_;
  const std::vector<Part>& parts_;
  Json* json_;
  GltfBinary* binary_;
  std::set<int> meshes_;
  std::set<std::pair<int, int>> in_rig_;  // mesh and primitive
};

// Key i shows target i alone.
void AnimateWeights(const GltfDocument& document, const TargetWriter& targets,
                    const std::vector<double>& key_times_s, GltfBinary* binary,
                    AnimationWriter* animation) {
  const int times = animation->AddTimes(key_times_s);
  const size_t num_keys = key_times_s.size();
  for (const int mesh : targets.meshes()) {
    const auto num_own = static_cast<size_t>(targets.NumOwn(mesh));
    std::uint64_t begin = 0;
    for (size_t key = 0; key < num_keys; ++key) {
      std::vector<float> weights(num_own + num_keys, 0.0f);
      weights[num_own + key] = 1;
      const std::uint64_t at = binary->Append(BytesOf(weights.data(), weights.size()));
      if (key == 0) begin = at;
    }
    const int values = binary->AddJson({{"bufferView", binary->ViewFrom(begin)},
                                        {"componentType", TINYGLTF_COMPONENT_TYPE_FLOAT},
                                        {"count", num_keys * (num_own + num_keys)},
                                        {"type", "SCALAR"}});
    for (size_t n = 0; n < document.model.nodes.size(); ++n) {
      const tinygltf::Node& node = document.model.nodes[n];
      if (node.mesh != mesh || node.skin < 0 || !document.in_scene[n]) continue;
      animation->AddChannel(static_cast<int>(n), "weights", times, values);
    }
  }
}

}  // namespace

GltfSurfaceError WriteSurface(const GltfDocument& document, const GltfRig& original,
                              const RigAsset& rig, bool other_proportions,
                              const GltfPerformance& performance,
                              const std::vector<std::vector<Eigen::Affine3d>>& shown, Json* json,
                              GltfBinary* binary, AnimationWriter* animation) {
  RequireOneSkin(document, original, "its surface cannot be written");
  const std::vector<double>& times = performance.times_s;
  const int num_frames = static_cast<int>(times.size());
  std::vector<int> keys;
  for (int f = 0; f < num_frames - 1; f += performance.frames_per_target) keys.push_back(f);
  keys.push_back(num_frames - 1);

  const std::vector<Part> parts = MakeParts(document, original, rig, other_proportions);
  TargetWriter targets(document, parts, json, binary);
  Frame frame(parts, original, shown);
  GltfSurfaceError error;
  double sum = 0;
  std::int64_t count = 0;
  Eigen::Matrix3Xf before, now;
  std::vector<double> key_times;
  for (size_t k = 0; k < keys.size(); ++k) {
    frame.Read(keys[k], performance.surface);
    frame.Offsets(&now);
    frame.Measure(now, &sum, &count, &error.max_m);
    targets.Add(now);
    key_times.push_back(times[keys[k]]);
    for (int f = k == 0 ? 0 : keys[k - 1] + 1; f < keys[k]; ++f) {
      frame.Read(f, performance.surface);
      const double time = times[f];
      const auto blend =
          static_cast<float>((time - key_times[k - 1]) / (key_times[k] - key_times[k - 1]));
      frame.Measure((1 - blend) * before + blend * now, &sum, &count, &error.max_m);
    }
    before.swap(now);
  }
  targets.Finish(keys);
  AnimateWeights(document, targets, key_times, binary, animation);
  error.num_targets = static_cast<int>(keys.size());
  error.mean_m = count > 0 ? sum / static_cast<double>(count) : 0;
  return error;
}

}  // namespace mpc::internal
