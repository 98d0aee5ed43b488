// Purpose: from a clip's detections to the energies of each frame.
// Source: paper, Section 4: d3d "have to be rescaled to match the actor model", w_f from PCK_f.
// Frames: body = camera frame. Units: metres, pixels. Symbols: J joints of the skeleton, F frames.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/pose/frame_problem.h"
#include "mpc/pose/pose_options.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

// Typical error of a 2D detection at the person, and the cost of one joint that is off by it: the
// scale on which priors are weighed against detections.
inline constexpr double kError2dMm = 20;
inline constexpr double kNoiseCost = kError2dMm * kError2dMm / kNumPaperJoints;

// A bone between two observed joints and its length in the skeleton at rest.
struct EvidenceBone {
  int a = 0;  // indices into Skeleton::joints; a nearer the root
  int b = 0;
  double length = 0;  // m, at rest
  bool rigid = true;  // the length never changes; false across the spine or neck
  // The length on which 3D errors were measured, over this one: a detection's errors grow with the
  // length it is rescaled to, so a shorter bone is no better explained.
  double gain = 1;
};

// Which detections have their left and right joints exchanged.
enum class SideSwap { kNone, k2d, k3d, kBoth };

// One frame's detections in the skeleton's terms.
struct FrameObservation {
  std::vector<Observation2d> points;         // confidence times the joint's trust as weight
  std::vector<int> bone;                     // indices into ClipEvidence::bones()
  std::vector<Eigen::Vector3d> bone_vector;  // camera axes, rescaled to the actor, m
  std::vector<double> bone_confidence;
  std::vector<int> joint_3d;                 // joints seen in 3D, indices into Skeleton::joints
  std::vector<Eigen::Vector3d> position_3d;  // camera axes, as detected, any origin, m
  std::vector<double> confidence_3d;
  std::vector<StandingJoint> standing;  // feet, by FindStandingFeet; weights 1
  std::vector<StandingJoint> floor;     // under all feet, by the same
  double scale_3d = 1;                  // the actor's lengths over the detected ones
  Eigen::Matrix3d camera_from_ray = Eigen::Matrix3d::Identity();
  double mm_per_px = 0;  // at the person, from t_f
  double error_mm = 0;   // that error at the person, per joint in the middle
  double pck = 1e3;      // PCK_f: 2D error of the projected 3D detection over the torso's length
  bool use_3d = false;   // w_f
};

class ClipEvidence {
 public:
  // detections3d may be null. camera_motion: where a moving camera is in each frame (F), in place of
  // the camera's own extrinsics; empty: it stands. Throws Error (kMismatch) for another length than F.
  ClipEvidence(const Skeleton& skeleton, const Camera& camera, const Detections2d& detections2d,
               const Detections3d* detections3d, double fps, const PoseOptions& options,
               std::span<const CameraFromWorld> camera_motion = {});

  // The same evidence for another skeleton with the same joints.
  ClipEvidence ForSkeleton(const Skeleton& skeleton) const;

  const Skeleton& skeleton() const { return skeleton_; }
  const Camera& camera() const { return camera_; }
  // See BaseFromCamera; whether the base is a known world.
  const std::vector<Rigid<WorldFrame, CameraFrame>>& base_from_camera() const {
    return base_from_camera_;
  }
  bool has_world() const { return has_world_; }
  const PoseOptions& options() const { return options_; }
  const std::vector<EvidenceBone>& bones() const { return bones_; }
  int num_frames() const { return static_cast<int>(detections2d_->frames.size()); }
  double fps() const { return fps_; }
  // Of the 2D detections per axis, at the person.
  double error_2d_mm() const { return error_2d_mm_; }
  // Share of the 3D error's variance that changes from frame to frame; the rest lasts for seconds.
  double white_share() const { return white_share_; }

  // 2D residuals weigh (20 mm / error)^2. The error is measured in two steps: a first solution that
  // trusts the 2D detections as far as they can be trusted, and how far they lie from it per axis
  // (poses N x F, with the observations they explain). Below 15 frames per second it stays 20 mm.
  void TrustError2d();
  void MeasureError2d(const std::vector<FrameObservation>& observations,
                      const Eigen::MatrixXd& poses);

  // Once the limbs are chosen, for the last solution: 3D errors that last count as
  // options().lasting_discount times as large, the less the nearer they are to what can be measured, and
  // the rest prior's variance as that much larger.
  void DiscountLasting();

  // hips: where they are in the camera, if known: the ray that ray-aligned 3D detections follow.
  // Without, the ray through the middle of the 2D points stands for it.
  FrameObservation Observe(int f, SideSwap swap = SideSwap::kNone,
                           const Eigen::Vector3d* hips = nullptr) const;

  // The same observation, made for another skeleton, for this one.
  FrameObservation Rescaled(FrameObservation observation) const;

  // The frame's energies. depth_m: distance of the person along the optical axis, for the unit of
  // 2D residuals. loss_width: factor on the options' robust scales, 0 for plain squares. rest: the
  // rest prior's target (N). joints: those of a pose near the solution, if known (3xJ): so far as the
  // errors of the 3D detections are white, joints count on their own there instead of bones.
  FrameProblem MakeProblem(const FrameObservation& observation, double depth_m, double loss_width,
                           const Eigen::VectorXd& rest,
                           const Eigen::Matrix3Xd* joints = nullptr) const;

 private:
  bool Position3d(int f, JointId id, SideSwap swap, Eigen::Vector3d* position,
                  double* confidence) const;
  void MeasurePck(int f, SideSwap swap, const Eigen::Matrix3d& camera_from_detection,
                  FrameObservation* observation) const;
  void MeasureError3d();

  void SetSkeleton(const Skeleton& skeleton);

  Skeleton skeleton_;
  Camera camera_;
  std::vector<Rigid<WorldFrame, CameraFrame>> base_from_camera_;  // F
  bool has_world_ = false;
  std::shared_ptr<const Detections2d> detections2d_;  // repaired
  std::shared_ptr<const Detections3d> detections3d_;  // repaired; may be null
  double fps_ = 0;
  PoseOptions options_;
  std::vector<EvidenceBone> bones_;
  double error_2d_mm_ = kError2dMm;
  double error_3d_mm_ = 0;        // typical error of the 3D detections across the ray
  double depth_error_ratio_ = 1;  // and along the ray over that
  double white_share_ = 0;
  double lasting_weight_ = 1;
  double error_white_mm_ = 0;                    // that part across the ray, per axis
  Eigen::VectorXd rest_spreads_;                 // per hinge, rad
  Eigen::VectorXd rest_weights_;                 // per hinge, per rad^2
  std::array<int, kNumJointIds> joint_index_{};  // into Skeleton::joints, -1: not there
  std::array<int, kNumJointIds> column3d_{};     // into Detections3d::joints, -1: not there
};

// A relaxed standing pose: arms down, limbs slightly bent (N; root zero). The rest prior's target
// and a start for solvers. Hinges that the default skeleton does not name rest at zero.
Eigen::VectorXd RelaxedPose(const Skeleton& skeleton);

}  // namespace mpc
