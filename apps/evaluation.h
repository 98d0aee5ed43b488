// Purpose: a captured performance against the truth: all metrics that the truth allows.
// Source: mpc/eval/*.h compute the numbers; docs/evaluation.md says what they mean.
// Frames: joints, surfaces and masks are compared in the camera frame, so that static and moving
// cameras are treated alike; what is about motion (jitter, acceleration, feet) in the truth's world.
// Symbols: J scored joints, F frames.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/progress.h"
#include "mpc/eval/foot_skate.h"
#include "mpc/eval/metrics.h"
#include "mpc/io/joint_truth_file.h"
#include "mpc/skeleton/character.h"

namespace monoperfcap {

struct Truth {
  std::string name;  // of its file
  mpc::JointTrack joints;
  std::optional<mpc::Camera> camera;         // of the clip; without it that of the capture
  std::vector<mpc::CameraFromWorld> motion;  // F places of a moving camera, else empty
  bool has_floor = false;                    // the world is y up with the floor at y = 0
  std::filesystem::path vertices;            // PC2 in the world; empty: unknown
  std::filesystem::path masks;               // likewise
  std::filesystem::path video;
};

// A truth.json, its folder, or a file of joints in the world of the capture's camera file; with the
// masks in `true_masks` if that is not empty. Throws mpc::Error.
Truth ReadTruth(const std::filesystem::path& path, const std::filesystem::path& true_masks = {});

// What was captured, in the camera frame. What is referred to must outlive the object.
struct Performance {
  std::string name;
  const mpc::Camera& camera;
  const mpc::Character& character;
  const Eigen::MatrixXd& poses;  // N x F
  double fps = 0;
  // Vertices of a frame (3xV), from several threads at a time; empty: the skinned character.
  std::function<void(int, Eigen::Matrix3Xf*)> vertices;
  std::filesystem::path silhouettes;  // masks that were extracted; empty: none
};

// Of the posed mesh, or of extracted silhouettes, against the true masks, per frame.
struct MaskScores {
  Eigen::VectorXd iou;         // F
  Eigen::VectorXd boundary_f;  // F
};

struct SurfaceScores {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // removed from the clip, camera frame, m
  Eigen::VectorXd vertex_mm;                              // F
  Eigen::VectorXd surface_mm;                             // F; empty when not asked for
};

struct Evaluation {
  std::string estimate;
  std::string truth;
  double fps = 0;
  std::vector<mpc::JointId> joints;
  mpc::JointErrors errors;
  mpc::SecondDifference jitter;
  mpc::SecondDifference truth_jitter;
  mpc::SecondDifference acceleration;
  mpc::BoneLengthDeviation bones;
  // What the truth does not allow is empty and named in `skipped`, one sentence each.
  std::optional<mpc::ReprojectionError> reprojection;
  std::optional<mpc::FootSkate> skate;
  std::optional<SurfaceScores> surface;
  std::optional<MaskScores> model;
  std::optional<MaskScores> silhouettes;
  std::vector<std::string> skipped;

  int num_frames() const { return errors.num_frames; }
};

// Which joints are scored: the 14 of the papers, or all that both have.
enum class JointSet { k14, kAll };

// Two tracks of joints in one world; the names are those of their files. Throws mpc::Error
// (kMismatch) for other numbers of frames, or without a joint in common.
Evaluation EvaluateJoints(const mpc::JointTrack& estimate, const mpc::JointTrack& truth,
                          JointSet joints, const std::string& estimate_name,
                          const std::string& truth_name);

struct EvaluationOptions {
  JointSet joints = JointSet::k14;
  bool surface_distance = true;  // also from surface to surface, which takes most of the time
  int num_threads = 0;           // 0: all cores; results do not depend on it
};

// Throws mpc::Error: kMismatch for other numbers of frames or joints, kCancelled when the progress
// callback stops the work, and what reading the truth's files throws.
Evaluation Evaluate(const Performance& performance, const Truth& truth,
                    const EvaluationOptions& options, const mpc::ProgressCallback& progress = {});

// The vertices of a performance, and its mask, in one frame.
void PoseVertices(const Performance& performance, int frame, Eigen::Matrix3Xf* vertices);

// Where the camera is in a frame of the truth's clip.
mpc::CameraFromWorld CameraPlace(const Performance& performance, const Truth& truth, int frame);

}  // namespace monoperfcap
