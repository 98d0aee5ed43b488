#include <fmt/format.h>

#include <cmath>
#include <string>

#include "gltf_animation.h"
#include "gltf_binary.h"
#include "gltf_document.h"
#include "gltf_nodes.h"
#include "gltf_proportions.h"
#include "gltf_source.h"
#include "gltf_surface.h"
#include "mpc/core/error.h"
#include "mpc/io/gltf.h"
#include "mpc/io/pc2.h"

namespace mpc {
namespace {

using internal::GltfDocument;

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

void CheckSurface(const RigAsset& rig, const GltfPerformance& performance) {
  if (performance.surface == nullptr) return;
  if (performance.frames_per_target < 1) {
    throw Error(
        ErrorCode::kInvalidArgument,
        fmt::format("performance: a morph target every {} frames", performance.frames_per_target));
  }
  const Pc2Reader& surface = *performance.surface;
  if (surface.num_vertices() != rig.num_vertices() ||
      static_cast<size_t>(surface.num_frames()) != performance.times_s.size()) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("the surface has {} vertices and {} frames, the rig {} and the "
                            "performance {}",
                            surface.num_vertices(), surface.num_frames(), rig.num_vertices(),
                            performance.times_s.size()));
  }
}

}  // namespace

GltfSurfaceError WriteGltfPerformance(const std::filesystem::path& path,
                                      const std::filesystem::path& source, const RigAsset& rig,
                                      const GltfPerformance& performance) {
  CheckPerformance(rig, performance);
  CheckSurface(rig, performance);
  const GltfDocument document = internal::LoadGltf(source);
  internal::GltfRig original = internal::BuildRig(document);
  CheckSameSource(document, original.rig, rig);
  const bool other_proportions = internal::HasOtherProportions(original.rig, rig);

  GltfSurfaceError error;
  try {
    nlohmann::ordered_json json = document.json;
    internal::GltfBinary binary(path, &json);
    internal::DropAnimations(document, &json);
    internal::GatherData(document, &json, &binary);
    if (other_proportions) {
      internal::RewriteProportions(document, rig, &json, &binary, &original);
    }
    const std::vector<internal::Trs> rest =
        internal::WriteRestPose(document, rig, other_proportions, &json);
    internal::AnimationWriter animation(&binary, performance.times_s);
    const auto shown = internal::AnimateBones(document, rig, rest, performance, &animation);
    if (performance.camera) internal::WriteCamera(document, performance, &json, &animation);
    if (performance.surface != nullptr) {
      error = internal::WriteSurface(document, original, rig, other_proportions, performance, shown,
                                     &json, &binary, &animation);
    }
    json["animations"] = nlohmann::ordered_json::array({animation.Finish()});
    binary.Finish();
  } catch (const nlohmann::ordered_json::exception& e) {
    document.Fail(fmt::format("not a valid glTF file: {}", e.what()));
  }
  return error;
}

}  // namespace mpc
