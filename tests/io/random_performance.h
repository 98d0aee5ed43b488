// Purpose: a rig's bones over a random motion, as a capture would give them.
#pragma once

#include "io/random_motion.h"
#include "mpc/io/gltf.h"
#include "mpc/io/pc2.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_pose.h"

namespace mpc::testing {

inline GltfPerformance RandomPerformance(const RigAsset& rig, const Character& character,
                                         int num_frames, double fps) {
  GltfPerformance performance;
  const Eigen::MatrixXd poses = RandomMotion(character.skeleton, num_frames, 5);
  KinematicState state;
  for (int f = 0; f < num_frames; ++f) {
    performance.times_s.push_back(f / fps);
    ForwardKinematics(character.skeleton, poses.col(f), &state);
    performance.scene_from_bone.emplace_back();
    RigBoneTransforms(rig, character, state, &performance.scene_from_bone.back());
  }
  return performance;
}

// The same for any rig, humanoid or not: every bone turns in its parent, the roots also move.
inline GltfPerformance RandomBonePerformance(const RigAsset& rig, int num_frames, double fps) {
  GltfPerformance performance;
  std::mt19937 rng(9);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Vector3d> axes(rig.bones.size());
  for (Eigen::Vector3d& axis : axes) axis = {normal(rng), normal(rng), normal(rng)};
  for (int f = 0; f < num_frames; ++f) {
    performance.times_s.push_back(f / fps);
    performance.scene_from_bone.emplace_back(rig.bones.size());
    std::vector<Eigen::Affine3d>& now = performance.scene_from_bone.back();
    const auto place = [&](const auto& self, int b) -> void {
      const RigBone& bone = rig.bones[b];
      const double angle = std::sin(0.1 * f + b);
      const Eigen::AngleAxisd turn(angle, axes[b].normalized());
      if (bone.parent < 0) {
        now[b] = Eigen::Translation3d(0.01 * f, 0, 0.1) * bone.scene_from_bone * turn;
      } else {
        self(self, bone.parent);
        now[b] = now[bone.parent] * rig.bones[bone.parent].scene_from_bone.inverse() *
                 bone.scene_from_bone * turn;
      }
    };
    for (size_t b = 0; b < now.size(); ++b) place(place, static_cast<int>(b));
  }
  return performance;
}

// Vertices of one of the rig's meshes by its own bones from the bind pose: linear blend, 3xV.
inline Eigen::Matrix3Xd SkinnedVertices(const RigAsset& rig,
                                        const std::vector<Eigen::Affine3d>& scene_from_bone,
                                        size_t mesh_index = 0) {
  const RigMesh& mesh = rig.meshes[mesh_index];
  Eigen::Matrix3Xd out = Eigen::Matrix3Xd::Zero(3, mesh.mesh.positions.cols());
  for (Eigen::Index v = 0; v < out.cols(); ++v) {
    const Eigen::Vector3d x = mesh.mesh.positions.col(v).cast<double>();
    const double sum = mesh.weights.col(v).cast<double>().sum();
    for (Eigen::Index k = 0; k < mesh.weights.rows(); ++k) {
      const int bone = mesh.bones(k, v);
      out.col(v) += mesh.weights(k, v) / sum *
                    (scene_from_bone[bone] * (rig.bones[bone].scene_from_bone.inverse() * x));
    }
  }
  return out;
}

// A surface that waves about the skinned meshes: all vertices of every frame, 3xV, in the scene.
inline std::vector<Eigen::Matrix3Xf> WavingSurface(const RigAsset& rig,
                                                   const GltfPerformance& performance,
                                                   double amplitude_m = 0.03) {
  std::vector<Eigen::Matrix3Xf> surface;
  for (size_t f = 0; f < performance.times_s.size(); ++f) {
    Eigen::Matrix3Xf all(3, rig.num_vertices());
    Eigen::Index begin = 0;
    for (size_t m = 0; m < rig.meshes.size(); ++m) {
      const Eigen::Matrix3Xd skinned = SkinnedVertices(rig, performance.scene_from_bone[f], m);
      const Eigen::ArrayXXd wave = (5 * skinned.array() + 0.7 * static_cast<double>(f)).sin();
      all.middleCols(begin, skinned.cols()) = (skinned + amplitude_m * wave.matrix()).cast<float>();
      begin += skinned.cols();
    }
    surface.push_back(std::move(all));
  }
  return surface;
}

inline Pc2Reader WriteSurface(const std::filesystem::path& path,
                              const std::vector<Eigen::Matrix3Xf>& surface) {
  Pc2Writer writer(path, static_cast<int>(surface.front().cols()));
  for (const Eigen::Matrix3Xf& positions : surface) writer.Write(positions);
  writer.Close();
  return Pc2Reader(path);
}

}  // namespace mpc::testing
