#include "gltf_animation.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace mpc::internal {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMovedM = 2e-6;  // a bone that stays nearer than this keeps its translation
constexpr double kScaleTolerance = 1e-4;

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

}  // namespace

AnimationWriter::AnimationWriter(GltfBinary* binary, const std::vector<double>& times_s)
    : binary_(binary), input_(AddTimes(times_s)) {}

int AnimationWriter::AddTimes(const std::vector<double>& times_s) {
  Eigen::MatrixXf times(1, times_s.size());
  for (size_t f = 0; f < times_s.size(); ++f) times(0, f) = static_cast<float>(times_s[f]);
  return binary_->AddAccessor(times, "SCALAR", 0, /*with_bounds=*/true);
}

void AnimationWriter::AddChannel(int node, const char* path, const Eigen::MatrixXf& values) {
  const char* const type = values.rows() == 4 ? "VEC4" : "VEC3";
  AddChannel(node, path, input_, binary_->AddAccessor(values, type, 0, /*with_bounds=*/false));
}

void AnimationWriter::AddChannel(int node, const char* path, int times, int values) {
  channels_.push_back(
      {{"sampler", samplers_.size()}, {"target", {{"node", node}, {"path", path}}}});
  samplers_.push_back({{"input", times}, {"interpolation", "LINEAR"}, {"output", values}});
}

Json AnimationWriter::Finish() const {
  return {{"name", "performance"}, {"channels", channels_}, {"samplers", samplers_}};
}

std::vector<std::vector<Eigen::Affine3d>> AnimateBones(const GltfDocument& document,
                                                       const RigAsset& rig,
                                                       const std::vector<Trs>& rest,
                                                       const GltfPerformance& performance,
                                                       AnimationWriter* animation) {
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
  std::vector<std::vector<Eigen::Affine3d>> shown;
  for (const RigBone& bone : rig.bones) shown.push_back(std::move(world[bone.node]));
  return shown;
}

}  // namespace mpc::internal
