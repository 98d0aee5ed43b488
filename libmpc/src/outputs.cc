#include "outputs.h"

#include <fmt/format.h>

#include <array>
#include <optional>
#include <string>
#include <system_error>

#include "mpc/core/error.h"
#include "mpc/eval/motions.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/bvh.h"
#include "mpc/io/gltf.h"
#include "mpc/io/pc2.h"
#include "mpc/io/trc.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/rig_pose.h"
#include "mpc/skeleton/skinning.h"

namespace mpc::internal {

namespace fs = std::filesystem;

namespace {

constexpr std::array<JointId, 17> kMarkers = {
    JointId::kPelvis,     JointId::kNeck,      JointId::kHeadTop,       JointId::kLeftShoulder,
    JointId::kLeftElbow,  JointId::kLeftWrist, JointId::kLeftHip,       JointId::kLeftKnee,
    JointId::kLeftAnkle,  JointId::kLeftToe,   JointId::kRightShoulder, JointId::kRightElbow,
    JointId::kRightWrist, JointId::kRightHip,  JointId::kRightKnee,     JointId::kRightAnkle,
    JointId::kRightToe};

// The poses seen from another frame; to_from_camera(f) is the transform in frame f.
template <typename ToFromCamera>
Eigen::MatrixXd PosesIn(const ToFromCamera& to_from_camera, const Eigen::MatrixXd& poses) {
  Eigen::MatrixXd result(poses.rows(), poses.cols());
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    const auto& transform = to_from_camera(f);
    result.col(f) = TransformPoses(transform.rotation, transform.translation, poses.col(f));
  }
  return result;
}

Eigen::MatrixXd PosesInScene(const Performance& performance) {
  return PosesIn([&](Eigen::Index f) { return performance.world.SceneFromCamera(f); },
                 performance.poses);
}

}  // namespace

GltfSurfaceError WritePerformanceGltf(const std::filesystem::path& path,
                                      const std::filesystem::path& actor,
                                      const Performance& performance,
                                      const std::filesystem::path& surface, int frames_per_target) {
  const Eigen::MatrixXd poses = PosesInScene(performance);
  GltfPerformance gltf;
  gltf.camera = performance.camera;
  gltf.scene_from_camera.clear();
  const bool moving = !performance.world.moving_world_from_camera.empty();
  for (Eigen::Index f = 0; f < (moving ? poses.cols() : 1); ++f) {
    const Rigid<SceneFrame, CameraFrame> place = performance.world.SceneFromCamera(f);
    gltf.scene_from_camera.emplace_back(Eigen::Translation3d(place.translation) *
                                        Eigen::Quaterniond(place.rotation));
  }
  gltf.scene_from_bone.resize(static_cast<size_t>(poses.cols()));
  KinematicState state;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    ForwardKinematics(performance.character.skeleton, poses.col(f), &state);
    gltf.times_s.push_back(static_cast<double>(f) / performance.fps);
    RigBoneTransforms(performance.rig, performance.character, state,
                      &gltf.scene_from_bone[static_cast<size_t>(f)]);
  }
  std::optional<Pc2Reader> reader;
  if (!surface.empty()) gltf.surface = &reader.emplace(surface);
  gltf.frames_per_target = frames_per_target;
  return WriteGltfPerformance(path, actor, performance.rig, gltf);
}

void WriteMotionBvh(const std::filesystem::path& path, const Performance& performance) {
  const Eigen::MatrixXd poses = PosesInScene(performance);
  WriteBvh(path, BvhFromPoses(performance.character.skeleton, poses, performance.fps));
}

void WriteJointsTrc(const std::filesystem::path& path, const Performance& performance) {
  const Skeleton& skeleton = performance.character.skeleton;
  const Eigen::MatrixXd joints = JointTrajectories(
      skeleton,
      PosesIn(
          [&](Eigen::Index f) -> const auto& { return performance.world.WorldFromCamera(f); },
          performance.poses));
  MarkerTrajectories markers;
  markers.fps = performance.fps;
  markers.positions.resize(3 * kMarkers.size(), joints.cols());
  for (size_t m = 0; m < kMarkers.size(); ++m) {
    markers.names.emplace_back(JointName(kMarkers[m]));
    markers.positions.middleRows<3>(static_cast<Eigen::Index>(3 * m)) =
        joints.middleRows<3>(3 * skeleton.FindJointIndex(kMarkers[m]));
  }
  WriteTrc(path, markers);
}

std::vector<std::string> DofNames(const Skeleton& skeleton) {
  std::vector<std::string> names = {"root_tx", "root_ty", "root_tz",
                                    "root_rx", "root_ry", "root_rz"};
  for (const Hinge& hinge : skeleton.hinges) names.push_back(hinge.name);
  return names;
}

void PrepareOutput(const fs::path& output, std::span<const fs::path> inputs,
                   std::span<const char* const> names) {
  std::error_code ec;
  fs::create_directories(output, ec);
  if (!fs::is_directory(output, ec)) {
    throw Error(ErrorCode::kWriteFailed,
                fmt::format("{} is not a folder and cannot be made one", output.string()));
  }
  for (const fs::path& input : inputs) {
    for (const char* name : names) {
      if (!input.empty() && fs::equivalent(input, output / name, ec)) {
        throw Error(ErrorCode::kInvalidArgument,
                    fmt::format("{} is an input and would be overwritten: choose another output "
                                "folder",
                                input.string()));
      }
    }
  }
  const fs::path probe = output / ".mpc_write_test";
  WriteFileAtomically(probe, "x");
  fs::remove(probe, ec);
}

}  // namespace mpc::internal
