#include <fmt/format.h>

#include <memory>

#include "mpc/core/error.h"
#include "mpc/free_view.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/pc2.h"
#include "mpc/io/world_file.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"
#include "outputs.h"

namespace mpc {
namespace {

template <typename To, typename From>
Eigen::Isometry3d Isometry(const Rigid<To, From>& transform) {
  return Eigen::Translation3d(transform.translation) * Eigen::Quaterniond(transform.rotation);
}

// Where the vertices of each frame are for the view's camera; also reads that camera.
std::vector<Eigen::Isometry3d> CameraFromVertices(const Take& take, const TakeView& view,
                                                  bool in_scene, Camera* camera) {
  const Eigen::Index num_frames = take.poses.cols();
  const WorldPlacement world = ReadWorld(take.folder / internal::kReportName);
  const auto fail = [](const std::string& fault) { throw Error(ErrorCode::kMismatch, fault); };
  const auto check_length = [&](size_t found, const std::string& what) {
    if (found != 0 && static_cast<Eigen::Index>(found) != num_frames) {
      fail(fmt::format("{} has {} frames, the capture {}", what, found, num_frames));
    }
  };
  const bool moves = !world.moving_world_from_camera.empty();
  check_length(world.moving_world_from_camera.size(), "report.json");
  std::vector<CameraFromWorld> motion;
  if (!view.camera.empty()) {
    *camera = ReadCamera(view.camera);
    motion = ReadCameraMotion(view.camera);
    check_length(motion.size(), view.camera);
    if (motion.empty() && !camera->has_extrinsics) {
      fail(view.camera + " does not say where the camera is: no R and t");
    }
    if (!moves && !take.camera.has_extrinsics) {
      fail(
          fmt::format("the capture's own camera had no place in a world: where {} is relative to "
                      "it is not known",
                      view.camera));
    }
  }
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // of the person, in the scene
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    const Eigen::Vector3d root = take.poses.col(f).head<3>();
    middle += world.SceneFromCamera(f) * root / static_cast<double>(num_frames);
  }
  std::vector<Eigen::Isometry3d> camera_from_vertices;
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    const Eigen::Isometry3d scene_from_own = Isometry(world.SceneFromCamera(f));
    Eigen::Isometry3d camera_from_scene = scene_from_own.inverse();
    if (!view.camera.empty()) {
      const CameraFromWorld& place =
          motion.empty() ? camera->camera_from_world : motion[static_cast<size_t>(f)];
      camera_from_scene = Isometry(place * world.scene_from_world.Inverse());
    }
    const double angle = view.orbit_rad * static_cast<double>(f) / static_cast<double>(num_frames);
    const Eigen::Isometry3d turn = Eigen::Translation3d(middle) *
                                   Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()) *
                                   Eigen::Translation3d(-middle);
    camera_from_vertices.push_back(camera_from_scene * turn);
    if (!in_scene) camera_from_vertices.back() = camera_from_vertices.back() * scene_from_own;
  }
  return camera_from_vertices;
}

}  // namespace

ViewedSurface ViewOfTake(const Take& take, const TakeView& view) {
  ViewedSurface viewed = {.rig = take.rig,
                          .camera = take.camera,
                          .fps = take.fps,
                          .num_frames = static_cast<int>(take.poses.cols()),
                          .inputs = {take.video, take.actor}};
  std::shared_ptr<Pc2Reader> cache;
  const std::filesystem::path file = take.folder / internal::kSurfaceName;
  std::error_code ec;
  if (std::filesystem::exists(file, ec)) {
    cache = std::make_shared<Pc2Reader>(file);
    if (cache->num_frames() != viewed.num_frames ||
        cache->num_vertices() != take.rig.num_vertices()) {
      throw Error(ErrorCode::kMismatch,
                  fmt::format("{} has {} vertices and {} frames, the actor {} and the capture {}",
                              file.string(), cache->num_vertices(), cache->num_frames(),
                              take.rig.num_vertices(), viewed.num_frames));
    }
  }
  std::vector<Eigen::Isometry3d> camera_from_vertices;  // empty: they are in the camera's frame
  if (cache || !view.camera.empty() || view.orbit_rad != 0) {
    camera_from_vertices = CameraFromVertices(take, view, cache != nullptr, &viewed.camera);
  }
  viewed.vertices = [&take, cache, camera_from_vertices](int frame, Eigen::Matrix3Xf* vertices) {
    if (cache) {
      cache->Read(frame, vertices);
    } else {
      KinematicState state;
      ForwardKinematics(take.character.skeleton, take.poses.col(frame), &state);
      SkinCharacter(take.character, state, vertices);
    }
    if (camera_from_vertices.empty()) return;
    const Eigen::Isometry3d& place = camera_from_vertices[static_cast<size_t>(frame)];
    const Eigen::Matrix3Xd turned = place.linear() * vertices->cast<double>();
    *vertices = (turned.colwise() + place.translation()).cast<float>();
  };
  return viewed;
}

}  // namespace mpc
