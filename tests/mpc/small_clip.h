// Purpose: a tiny clip with exact truth and all files a capture needs, made from a rig of boxes.
// Frames: world y up, floor at y = 0. Units: metres. Symbols: F frames.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>

#include "io/temp_dir.h"
#include "mpc/capture.h"
#include "mpc/eval/motions.h"
#include "mpc/eval/synthetic.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/rig_gltf.h"
#include "mpc/io/video.h"
#include "mpc/skeleton/character.h"
#include "support/test_rig.h"

namespace mpc::testing {

// Stands 4 m in front of the origin, 1 m up, looking slightly down along -z.
inline Camera SmallCamera(int width, int height) {
  Camera camera = Camera::FromFov(width, height, 0.9);
  camera.name = "small";
  camera.camera_from_world.rotation =
      ExpSO3({0.15, 0, 0}) * Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.camera_from_world.translation =
      -(camera.camera_from_world.rotation * Eigen::Vector3d(0, 1.5, 4));
  camera.has_extrinsics = true;
  return camera;
}

// The pictures are noise, so that the overlay is as large as a video can be.
inline void WriteNoiseVideo(const std::filesystem::path& path, int width, int height, double fps,
                            int num_frames) {
  cv::RNG rng(1);
  VideoWriter writer(path, width, height, fps);
  cv::Mat picture(height, width, CV_8UC3);
  for (int f = 0; f < num_frames; ++f) {
    rng.fill(picture, cv::RNG::UNIFORM, 0, 256);
    writer.Write(picture);
  }
  writer.Close();
}

struct SmallClip {
  explicit SmallClip(int frames = 24) : num_frames(frames), camera(SmallCamera(kWidth, kHeight)) {
    character = BuildCharacter(rig, MapRigByNames(rig));
    const Eigen::MatrixXd poses =
        MakeMotion(character.skeleton, MotionKind::kReach, num_frames / kFps, kFps);
    const Eigen::MatrixXd in_camera = TransformPoses(camera.camera_from_world.rotation,
                                                     camera.camera_from_world.translation, poses);
    detections = SynthesizeDetections(character.skeleton, in_camera, camera, kFps,
                                      DetectionNoise::White(1, 20, 0, 0.05), /*seed=*/3);
    WriteRigGltf(inputs.actor = folder / "actor.glb", rig);
    WriteNoiseVideo(inputs.video = folder / "clip.mp4", kWidth, kHeight, kFps, num_frames);
    WriteCameras(folder / "camera.json", {camera});
    inputs.camera = (folder / "camera.json").string();
    WriteDetections(inputs.detections2d = folder / "detections2d.json", detections.detections2d);
    WriteDetections(inputs.detections3d = folder / "detections3d.json", detections.detections3d);
  }

  static constexpr int kWidth = 128;
  static constexpr int kHeight = 160;
  static constexpr double kFps = 25;

  TempDir folder;
  int num_frames;
  Camera camera;
  RigAsset rig = MakeTestRig();
  Character character;
  SyntheticDetections detections;
  CaptureInputs inputs;
};

}  // namespace mpc::testing
