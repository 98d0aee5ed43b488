// Purpose: from detections to the energies of each frame.
// Source: paper, Section 4: d3d "have to be rescaled to match the actor model", w_f from PCK_f.
// Frames: body = camera frame. Units: metres, pixels. Symbols: J joints of the skeleton, F frames.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/pose/frame_problem.h"
#include "mpc/pose/pose_options.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

// A bone between two observed joints, its length in the skeleton, and the limb it belongs to.
struct EvidenceBone {
  int a = 0;  // indices into Skeleton::joints; a nearer the root
  int b = 0;
  double length = 0;  // m, at rest
  int limb = -1;      // 0..3 left arm, right arm, left leg, right leg; -1 torso and head
};

// The bones 3D evidence is read from: hips, torso, head, limbs, feet; those whose joints the
// skeleton has, parents first.
std::vector<EvidenceBone> EvidenceBones(const Skeleton& skeleton);

// One frame's detections in the skeleton's terms.
struct FrameObservation {
  std::vector<Observation2d> points;         // confidence as weight
  std::vector<int> bone;                     // index into EvidenceBones
  std::vector<Eigen::Vector3d> bone_vector;  // camera axes, rescaled to the actor, m
  std::vector<double> bone_confidence;
  Eigen::Matrix3d camera_from_ray = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // t_f: pelvis in camera, best linear fit
  bool has_translation = false;
  double pck = 1;       // mean 2D error of the projected 3D detection over the torso's length
  bool use_3d = false;  // w_f
};

// Reads frame f of both sources (either may be null) into the skeleton's terms.
FrameObservation ObserveFrame(const Skeleton& skeleton, const std::vector<EvidenceBone>& bones,
                              const Camera& camera, const Detections2d* detections2d,
                              const Detections3d* detections3d, int f, const PoseOptions& options);

// The frame's energies. depth_m: distance of the person, for the unit of 2D residuals.
// flipped: per evidence bone, true to mirror its 3D vector in depth; empty for none.
FrameProblem MakeFrameProblem(const Skeleton& skeleton, const std::vector<EvidenceBone>& bones,
                              const Camera& camera, const FrameObservation& observation,
                              double depth_m, const std::vector<bool>& flipped,
                              const PoseOptions& options);

// A relaxed standing pose: arms down, limbs slightly bent (N; root zero). The rest prior's target
// and a start for solvers. Hinges that the default skeleton does not name rest mid-range.
Eigen::VectorXd RelaxedPose(const Skeleton& skeleton);

}  // namespace mpc
