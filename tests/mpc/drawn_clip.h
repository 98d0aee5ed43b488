// Purpose: a tiny clip that shows its actor: pictures, true masks, poses that are a little wrong.
// Frames: poses in the camera frame. Units: metres. Symbols: F frames.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/eval/dressed_actor.h"
#include "mpc/io/mask_file.h"
#include "mpc/render/raster.h"
#include "mpc/render/shade.h"
#include "mpc/silhouettes.h"
#include "mpc/skeleton/skinning.h"
#include "small_clip.h"

namespace mpc::testing {

struct DrawnClip {
  // The actor goes stride_m to the right from frame to frame, past the middle in the middle frame.
  // `size` times as large as kWidth x kHeight.
  explicit DrawnClip(int num_frames = 9, double stride_m = 0, int size = 1)
      : camera(SmallCamera(size * kWidth, size * kHeight)) {
    character = BuildCharacter(rig, MapRigByNames(rig));
    true_poses =
        TransformPoses(camera.camera_from_world.rotation, camera.camera_from_world.translation,
                       MakeMotion(character.skeleton, MotionKind::kReach, num_frames / kFps, kFps)
                           .leftCols(num_frames));
    for (int f = 0; f < num_frames; ++f) {
      true_poses(0, f) += stride_m * (f - 0.5 * (num_frames - 1));
    }
    poses = true_poses;
    poses.row(0).array() += 0.02;  // to the right
    background.create(camera.height, camera.width, CV_8UC3);
    cv::RNG(3).fill(background, cv::RNG::NORMAL, 70, 8);
    MeshAppearance appearance;
    appearance.bgr = {120, 140, 230};
    KinematicState state;
    Eigen::Matrix3Xf vertices;
    VideoWriter writer(video = folder / "drawn.mp4", camera.width, camera.height, kFps);
    MaskFolderWriter mask_writer(true_masks = folder / "true_masks");
    for (int f = 0; f < num_frames; ++f) {
      ForwardKinematics(character.skeleton, true_poses.col(f), &state);
      SkinCharacter(character, state, &vertices);
      cv::Mat picture = background.clone();
      ShadeMesh(camera, vertices, character.mesh.triangles, appearance, 1, &picture);
      writer.Write(picture);
      truth.push_back(MeshMask(camera, vertices, character.mesh.triangles));
      mask_writer.Write(truth.back());
    }
    writer.Close();
    mask_writer.Close();
  }

  PosedClip clip() const {
    return {.video = video, .camera = camera, .character = character, .poses = poses};
  }

  static constexpr int kWidth = 240;
  static constexpr int kHeight = 300;
  static constexpr double kFps = 25;

  TempDir folder;
  Camera camera;
  RigAsset rig = MakeDressedActor().rig;
  Character character;
  Eigen::MatrixXd true_poses;
  Eigen::MatrixXd poses;
  std::filesystem::path video;
  std::filesystem::path true_masks;
  cv::Mat background;
  std::vector<cv::Mat> truth;
};

}  // namespace mpc::testing
