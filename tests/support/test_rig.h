// Purpose: a small synthetic humanoid rig with a skinned mesh of boxes, in every shape a real rig
// comes in: T- or A-pose, bent limbs, turned, scaled armature, arbitrary bind rotations.
// Frames: scene frame, y up, facing +z unless turned. Units: metres. Symbols: B bones.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "mpc/skeleton/rig_asset.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc::testing {

struct TestRigOptions {
  double arm_down_rad = 0;      // 0: T-pose; about 0.8: A-pose
  double arm_forward_rad = 0;   // upper arm swung forward
  double arm_twist_rad = 0;     // upper arm about itself: tilts the plane of the elbow
  double elbow_bend_rad = 0;    // forearm forward of the upper arm
  double knee_bend_rad = 0;     // shank behind the thigh
  double yaw_rad = 0;           // turn of the whole rig about y
  double bone_scale = 1;        // scale inside the bones' matrices: 100 for centimetre armatures
  bool bone_rotations = false;  // arbitrary orientation of every bone
  unsigned seed = 1;
};

// Names of the bones in RigPart order, then two that are no part: a clavicle and a finger.
inline std::vector<std::string> TestBoneNames() {
  return {"hips",          "spine",         "chest",        "neck",          "head",
          "leftUpperArm",  "leftLowerArm",  "leftHand",     "rightUpperArm", "rightLowerArm",
          "rightHand",     "leftUpperLeg",  "leftLowerLeg", "leftFoot",      "leftToes",
          "rightUpperLeg", "rightLowerLeg", "rightFoot",    "rightToes",     "leftShoulder",
          "leftIndex"};
}

// A box around the line from a to b as 24 vertices in six rings, weights blended from bone `first`
// to bone `second` along it.
inline void AddBox(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius, int first,
                   int second, RigMesh* mesh) {
  constexpr int kRings = 6;
  const Eigen::Vector3d along = (b - a).normalized();
  const Eigen::Vector3d side = along.unitOrthogonal();
  const Eigen::Vector3d other = along.cross(side);
  const int begin = static_cast<int>(mesh->mesh.positions.cols());
  mesh->mesh.positions.conservativeResize(3, begin + 4 * kRings);
  mesh->bones.conservativeResize(2, begin + 4 * kRings);
  mesh->weights.conservativeResize(2, begin + 4 * kRings);
  const auto add_quad = [&](int i, int j, int k, int l) {
    const Eigen::Index t = mesh->mesh.triangles.cols();
    mesh->mesh.triangles.conservativeResize(3, t + 2);
    mesh->mesh.triangles.col(t) = Eigen::Vector3i(i, j, k);
    mesh->mesh.triangles.col(t + 1) = Eigen::Vector3i(i, k, l);
  };
  for (int ring = 0; ring < kRings; ++ring) {
    const double u = static_cast<double>(ring) / (kRings - 1);
    for (int corner = 0; corner < 4; ++corner) {
      const double angle = std::numbers::pi / 4 * (2 * corner + 1);
      const int v = begin + 4 * ring + corner;
      const Eigen::Vector3d x =
          a + u * (b - a) + radius * (std::cos(angle) * side + std::sin(angle) * other);
      mesh->mesh.positions.col(v) = x.cast<float>();
      const auto weight = static_cast<float>(first == second ? 1 : 1 - 0.5 * u * u);
      mesh->bones(0, v) = first;
      mesh->bones(1, v) = second;
      mesh->weights(0, v) = weight;
      mesh->weights(1, v) = 1 - weight;
      const int next = begin + 4 * ring + (corner + 1) % 4;
      if (ring + 1 < kRings) add_quad(v, next, next + 4, v + 4);
    }
  }
  add_quad(begin, begin + 3, begin + 2, begin + 1);
  const int end = begin + 4 * (kRings - 1);
  add_quad(end, end + 1, end + 2, end + 3);
}

inline RigAsset MakeTestRig(const TestRigOptions& options = {}) {
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  const Eigen::Matrix3d yaw = AngleAxisd(options.yaw_rad, Vector3d::UnitY()).toRotationMatrix();

  std::array<Vector3d, kNumRigParts + 2> x;
  const auto at = [&x](RigPart part) -> Vector3d& { return x[static_cast<size_t>(part)]; };
  at(RigPart::kHips) = {0, 0.96, 0.01};
  at(RigPart::kSpine) = {0, 1.12, -0.02};
  at(RigPart::kChest) = {0, 1.28, -0.02};
  at(RigPart::kNeck) = {0, 1.50, 0};
  at(RigPart::kHead) = {0, 1.60, 0.02};
  for (int side = 0; side < 2; ++side) {
    const double sign = side == 0 ? 1 : -1;
    const auto arm = [&](int i) -> Vector3d& {
      return x[static_cast<size_t>(RigPart::kLeftUpperArm) + 3 * side + i];
    };
    const auto leg = [&](int i) -> Vector3d& {
      return x[static_cast<size_t>(RigPart::kLeftUpperLeg) + 4 * side + i];
    };
    const auto about = [](double angle, const Vector3d& axis) {
      return AngleAxisd(angle, axis).toRotationMatrix();
    };
    const Eigen::Matrix3d upper = about(-sign * options.arm_down_rad, Vector3d::UnitZ()) *
                                  about(-sign * options.arm_forward_rad, Vector3d::UnitY()) *
                                  about(options.arm_twist_rad, Vector3d::UnitX());
    const Eigen::Matrix3d lower = upper * about(-sign * options.elbow_bend_rad, Vector3d::UnitY());
    arm(0) = {sign * 0.19, 1.43, -0.01};
    arm(1) = arm(0) + upper * Vector3d(sign * 0.28, 0, 0);
    arm(2) = arm(1) + lower * Vector3d(sign * 0.26, 0, 0);
    const AngleAxisd knee(options.knee_bend_rad, Vector3d::UnitX());
    leg(0) = {sign * 0.10, 0.94, 0};
    leg(1) = leg(0) + Vector3d(sign * 0.02, -0.42, 0.01);
    leg(2) = leg(1) + knee * Vector3d(sign * 0.01, -0.43, -0.02);
    leg(3) = leg(2) + Vector3d(sign * 0.01, -0.06, 0.13);
  }
  const int clavicle = kNumRigParts;
  const int finger = kNumRigParts + 1;
  x[clavicle] = {0.05, 1.44, 0};
  x[finger] = at(RigPart::kLeftHand) + Vector3d(0.05, 0, 0.02);
  for (Vector3d& position : x) position = yaw * position;

  const auto index = [](RigPart part) { return static_cast<int>(part); };
  std::vector<int> parents(x.size());
  for (int p = 0; p < kNumRigParts; ++p) parents[p] = p - 1;
  parents[index(RigPart::kLeftUpperArm)] = clavicle;
  parents[index(RigPart::kRightUpperArm)] = index(RigPart::kChest);
  parents[index(RigPart::kLeftUpperLeg)] = parents[index(RigPart::kRightUpperLeg)] = 0;
  parents[clavicle] = index(RigPart::kChest);
  parents[finger] = index(RigPart::kLeftHand);

  RigAsset rig;
  rig.source = "test rig";
  const std::vector<std::string> names = TestBoneNames();
  std::mt19937 rng(options.seed);
  std::normal_distribution<double> normal;
  for (size_t b = 0; b < x.size(); ++b) {
    RigBone bone;
    bone.name = names[b];
    bone.parent = parents[b];
    bone.node = static_cast<int>(b);
    bone.scene_from_bone.translation() = x[b];
    if (options.bone_rotations) {
      const Eigen::Vector4d q(normal(rng), normal(rng), normal(rng), normal(rng));
      bone.scene_from_bone.linear() = Eigen::Quaterniond(q.normalized()).toRotationMatrix();
    }
    bone.scene_from_bone.linear() *= options.bone_scale;
    rig.bones.push_back(bone);
  }

  RigMesh mesh;
  mesh.name = "body";
  mesh.mesh.positions.resize(3, 0);
  mesh.mesh.triangles.resize(3, 0);
  const auto box = [&](RigPart from, RigPart to, double radius) {
    AddBox(at(from), at(to), radius, index(from), index(to), &mesh);
  };
  box(RigPart::kHips, RigPart::kSpine, 0.13);
  box(RigPart::kSpine, RigPart::kChest, 0.12);
  box(RigPart::kChest, RigPart::kNeck, 0.13);
  box(RigPart::kNeck, RigPart::kHead, 0.05);
  AddBox(at(RigPart::kHead) + Vector3d(0, -0.05, 0), at(RigPart::kHead) + Vector3d(0, 0.18, 0),
         0.09, index(RigPart::kHead), index(RigPart::kHead), &mesh);
  for (int side = 0; side < 2; ++side) {
    const auto arm = [side](int i) {
      return static_cast<RigPart>(static_cast<int>(RigPart::kLeftUpperArm) + 3 * side + i);
    };
    const auto leg = [side](int i) {
      return static_cast<RigPart>(static_cast<int>(RigPart::kLeftUpperLeg) + 4 * side + i);
    };
    box(arm(0), arm(1), 0.045);
    box(arm(1), arm(2), 0.04);
    box(leg(0), leg(1), 0.08);
    box(leg(1), leg(2), 0.05);
    const Vector3d heel = at(leg(2)) + yaw * Vector3d(0, -0.05, -0.06);
    const Vector3d tip = at(leg(2)) + yaw * Vector3d(0, -0.05, 0.2);
    AddBox(heel, tip, 0.04, index(leg(2)), index(leg(3)), &mesh);
  }
  AddBox(x[clavicle], at(RigPart::kLeftUpperArm), 0.04, clavicle, index(RigPart::kLeftUpperArm),
         &mesh);
  AddBox(at(RigPart::kLeftHand), x[finger], 0.02, index(RigPart::kLeftHand), finger, &mesh);
  rig.meshes.push_back(mesh);
  return rig;
}

// The shapes every rig test goes through.
inline std::vector<TestRigOptions> TestRigVariants() {
  return {
      {},
      {.arm_down_rad = 0.8},
      {.arm_down_rad = 0.8, .elbow_bend_rad = 0.7, .knee_bend_rad = 0.4},
      {.arm_down_rad = 1.3, .elbow_bend_rad = 0.3},
      {.arm_down_rad = 0.6, .arm_forward_rad = 0.5, .arm_twist_rad = 0.4, .elbow_bend_rad = 0.5},
      {.arm_down_rad = 0.7, .yaw_rad = 2.5},
      {.yaw_rad = std::numbers::pi},
      {.bone_scale = 100},
      {.arm_down_rad = 0.8, .yaw_rad = -1.2, .bone_scale = 0.01, .bone_rotations = true}};
}

}  // namespace mpc::testing
