// Purpose: the animation "performance": keys of bones and camera.
#pragma once

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <vector>

#include "gltf_binary.h"
#include "gltf_document.h"
#include "gltf_nodes.h"
#include "mpc/io/gltf.h"

namespace mpc::internal {

class AnimationWriter {
 public:
  using Json = nlohmann::ordered_json;

  AnimationWriter(GltfBinary* binary, const std::vector<double>& times_s);

  int AddTimes(const std::vector<double>& times_s);  // returns the accessor
  // One column of `values` per time.
  void AddChannel(int node, const char* path, const Eigen::MatrixXf& values);
  // Keys that are in the file already.
  void AddChannel(int node, const char* path, int times, int values);

  Json Finish() const;

 private:
  GltfBinary* binary_;
  int input_ = 0;
  Json channels_ = Json::array();
  Json samplers_ = Json::array();
};

// Returns scene_from_bone as a viewer shows it: per bone and frame.
std::vector<std::vector<Eigen::Affine3d>> AnimateBones(const GltfDocument& document,
                                                       const RigAsset& rig,
                                                       const std::vector<Trs>& rest,
                                                       const GltfPerformance& performance,
                                                       AnimationWriter* animation);

// Adds the camera's node, animated where the camera moves.
void WriteCamera(const GltfDocument& document, const GltfPerformance& performance,
                 nlohmann::ordered_json* json, AnimationWriter* animation);

}  // namespace mpc::internal
