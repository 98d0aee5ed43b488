#include <algorithm>
#include <cmath>
#include <string>

#include "gltf_animation.h"

namespace mpc::internal {
namespace {

using Json = nlohmann::ordered_json;

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
int AddCameraNode(const GltfDocument& document, const Camera& camera,
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

}  // namespace

void WriteCamera(const GltfDocument& document, const GltfPerformance& performance, Json* json,
                 AnimationWriter* animation) {
  const std::vector<Eigen::Isometry3d>& places = performance.scene_from_camera;
  const int node = AddCameraNode(document, *performance.camera, places.front(), json);
  if (places.size() > 1) AnimateCamera(node, places, animation);
}

}  // namespace mpc::internal
