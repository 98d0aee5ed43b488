#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numbers>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "console.h"
#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/eval/motions.h"
#include "mpc/eval/synthetic.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/rig_gltf.h"
#include "mpc/io/trc.h"
#include "mpc/io/video.h"
#include "mpc/render/shade.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace monoperfcap {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

struct Arguments {
  fs::path output;
  std::string motion = "walk";
  std::string noise = "measured";
  double seconds = 3;
  double fps = 30;
  int width = 960;
  int height = 720;
  double fov_deg = 60;
  uint64_t seed = 1;
};

mpc::MotionKind FindMotion(const std::string& name) {
  for (const mpc::MotionKind kind : mpc::kAllMotions) {
    if (mpc::MotionName(kind) == name) return kind;
  }
  throw mpc::Error(mpc::ErrorCode::kInvalidArgument, "unknown motion " + name);
}

mpc::DetectionNoise MakeNoise(const std::string& name) {
  if (name == "measured") return mpc::DetectionNoise::Measured();
  if (name == "white") return mpc::DetectionNoise::White(5, 60, 0.1, 0.2);
  return {};
}

// All joints (3 x any number, camera frame) lie in the middle 80 % of the picture.
bool FitsPicture(const mpc::Camera& camera, const Eigen::Matrix3Xd& joints_in_camera) {
  for (const auto& x : joints_in_camera.colwise()) {
    Eigen::Vector2d pixel;
    if (!mpc::Project(camera, x, &pixel)) return false;
    if (std::abs(pixel.x() / camera.width - 0.5) > 0.4) return false;
    if (std::abs(pixel.y() / camera.height - 0.5) > 0.4) return false;
  }
  return true;
}

// Looks at the middle of the motion (world y up) from the front, slightly from above, from as near
// as all of it fits into the picture. `joints` is 3J x F in the world.
mpc::Camera MakeCamera(const Arguments& arguments, const Eigen::MatrixXd& joints) {
  constexpr double kPitch = 10 * std::numbers::pi / 180;
  mpc::Camera camera = mpc::Camera::FromFov(arguments.width, arguments.height,
                                            arguments.fov_deg * std::numbers::pi / 180);
  camera.name = "synth";
  camera.has_extrinsics = true;
  const Eigen::Matrix3Xd points = joints.reshaped(3, joints.size() / 3);
  const Vector3d center = (points.rowwise().minCoeff() + points.rowwise().maxCoeff()) / 2;
  mpc::CameraFromWorld& pose = camera.camera_from_world;
  pose.rotation = mpc::ExpSO3({kPitch, 0, 0}) * Vector3d(1, -1, -1).asDiagonal();
  const Eigen::Matrix3Xd around_center = pose.rotation * (points.colwise() - center);
  double distance = 1;
  while (!FitsPicture(camera, around_center.colwise() + Vector3d(0, 0, distance))) distance *= 1.02;
  pose.translation = Vector3d(0, 0, distance) - pose.rotation * center;
  return camera;
}

// A grey wall that darkens upwards.
cv::Mat Background(int width, int height) {
  cv::Mat picture(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    const double grey = 90 + 70.0 * y / height;
    picture.row(y).setTo(cv::Scalar(1.05 * grey, grey, 0.95 * grey));
  }
  return picture;
}

bool WriteClip(const Arguments& arguments, const mpc::Character& character,
               const Eigen::MatrixXd& poses_in_camera, const mpc::Camera& camera) {
  mpc::MeshAppearance appearance;
  appearance.bgr = {120, 140, 200};
  const cv::Mat background = Background(arguments.width, arguments.height);
  mpc::VideoWriter writer(arguments.output / "clip.mp4", arguments.width, arguments.height,
                          arguments.fps);
  ConsoleProgress progress(/*quiet=*/false);
  const int num_frames = static_cast<int>(poses_in_camera.cols());
  std::vector<cv::Mat> pictures(static_cast<size_t>(2 * mpc::ResolveNumThreads(0)));
  for (int begin = 0; begin < num_frames;) {
    const int count = std::min(static_cast<int>(pictures.size()), num_frames - begin);
    mpc::ParallelFor(count, 0, [&](int i) {
      mpc::KinematicState state;
      mpc::ForwardKinematics(character.skeleton, poses_in_camera.col(begin + i), &state);
      Eigen::Matrix3Xf vertices;
      mpc::SkinCharacter(character, state, &vertices);
      cv::Mat& picture = pictures[static_cast<size_t>(i)];
      background.copyTo(picture);
      mpc::ShadeMesh(camera, vertices, character.mesh.triangles, appearance, 1, &picture);
    });
    for (int i = 0; i < count; ++i) writer.Write(pictures[static_cast<size_t>(i)]);
    begin += count;
    if (!progress({"clip", begin, num_frames})) return false;
  }
  writer.Close();
  return true;
}

void WriteTruth(const fs::path& path, const mpc::Skeleton& skeleton, const Eigen::MatrixXd& joints,
                double fps) {
  mpc::MarkerTrajectories markers;
  for (const mpc::SkeletonJoint& joint : skeleton.joints) {
    markers.names.emplace_back(mpc::JointName(joint.id));
  }
  markers.fps = fps;
  markers.positions = joints;
  mpc::WriteTrc(path, markers);
}

int Run(const Arguments& arguments) {
  std::error_code ec;
  fs::create_directories(arguments.output, ec);
  const mpc::RigAsset rig = mpc::MakeDressedActor().rig;
  mpc::WriteRigGltf(arguments.output / "actor.glb", rig);
  const mpc::Character character = mpc::BuildCharacter(rig, mpc::MapRigByNames(rig));
  const Eigen::MatrixXd poses = mpc::MakeMotion(character.skeleton, FindMotion(arguments.motion),
                                                arguments.seconds, arguments.fps);
  const Eigen::MatrixXd joints = mpc::JointTrajectories(character.skeleton, poses);
  const mpc::Camera camera = MakeCamera(arguments, joints);
  const Eigen::MatrixXd poses_in_camera = mpc::TransformPoses(
      camera.camera_from_world.rotation, camera.camera_from_world.translation, poses);
  const mpc::SyntheticDetections detections =
      mpc::SynthesizeDetections(character.skeleton, poses_in_camera, camera, arguments.fps,
                                MakeNoise(arguments.noise), arguments.seed);
  mpc::WriteCameras(arguments.output / "camera.json", {camera});
  mpc::WriteDetections(arguments.output / "detections2d.json", detections.detections2d);
  mpc::WriteDetections(arguments.output / "detections3d.json", detections.detections3d);
  WriteTruth(arguments.output / "truth.trc", character.skeleton, joints, arguments.fps);
  if (!WriteClip(arguments, character, poses_in_camera, camera)) return kExitInterrupted;
  std::printf("%s", fmt::format("{}: actor.glb clip.mp4 camera.json detections2d.json "
                                "detections3d.json truth.trc\n{} frames of \"{}\"\n",
                                arguments.output.string(), poses.cols(), arguments.motion)
                        .c_str());
  return kExitOk;
}

}  // namespace

Command AddSynthCommand(CLI::App* parent) {
  CLI::App* const app =
      parent->add_subcommand("synth", "Make a clip with known truth to try the capture on");
  const auto arguments = std::make_shared<Arguments>();
  std::vector<std::string> motions;
  for (const mpc::MotionKind kind : mpc::kAllMotions) motions.emplace_back(mpc::MotionName(kind));
  app->add_option("-o,--output", arguments->output, "Folder for the files")->required();
  app->add_option("--motion", arguments->motion, "What the actor does")
      ->check(CLI::IsMember(motions))
      ->capture_default_str();
  app->add_option("--noise", arguments->noise,
                  "Errors of the detections: none, white, or as measured on a network")
      ->check(CLI::IsMember({"none", "white", "measured"}))
      ->capture_default_str();
  app->add_option("--seconds", arguments->seconds, "Length of the clip")
      ->check(CLI::Range(0.01, 3600.0))
      ->capture_default_str();
  app->add_option("--fps", arguments->fps, "Frames per second")
      ->check(CLI::Range(1.0, 240.0))
      ->capture_default_str();
  app->add_option("--width", arguments->width, "Width of the picture")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  app->add_option("--height", arguments->height, "Height of the picture")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  app->add_option("--fov", arguments->fov_deg, "Field of view of the longer side, degrees")
      ->check(CLI::Range(10.0, 120.0))
      ->capture_default_str();
  app->add_option("--seed", arguments->seed, "Of the errors")->capture_default_str();
  return {app, [arguments] { return Run(*arguments); }};
}

}  // namespace monoperfcap
