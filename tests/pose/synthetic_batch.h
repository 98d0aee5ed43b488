// Purpose: a batch of frames with known truth, and the plain numbers its energies are made of, so
// that twins and baselines can build the same cost their own way.
// Frames: camera frame. Symbols: N dofs, F frames, K basis vectors.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/rigid.h"
#include "mpc/eval/motions.h"
#include "mpc/pose/batch_solver.h"
#include "mpc/pose/clip_evidence.h"
#include "mpc/pose/trajectory_basis.h"

namespace mpc::testing {

inline Camera SyntheticCamera() { return Camera::FromFov(1920, 1080, 1.0); }

// A motion of the given number of frames, seen upright from 4 m away.
inline Eigen::MatrixXd MotionInCamera(const Skeleton& skeleton, MotionKind kind, int num_frames,
                                      double fps) {
  return TransformPoses(ExpSO3({std::numbers::pi, 0, 0}), {0.1, 0.9, 4},
                        MakeMotion(skeleton, kind, num_frames / fps, fps));
}

// Which terms and weights: the paper's, or ours at about the default's values (fixed here, so that
// tuning the default does not change what solvers are tested on).
enum class Terms { kPaper, kOurs };

// What the energies of one frame are made of.
struct FrameIngredients {
  std::vector<Observation2d> points;
  double unit_per_px = 1;
  double robust_2d = 0;
  std::vector<int> joints;  // E_3d of the paper
  Eigen::Matrix3Xd positions{3, 0};
  double weight_3d = 0;
  std::vector<BoneObservation> bones;  // ours
  Eigen::Matrix3d body_from_ray = Eigen::Matrix3d::Identity();
  BoneVectorWeights bone_weights;
  Eigen::VectorXd rest;  // per hinge, or empty
  Eigen::VectorXd rest_weights;

  void SetRestPrior(const Skeleton& skeleton, double weight) {
    rest = RelaxedPose(skeleton).tail(skeleton.num_dofs() - 6);
    rest_weights = Eigen::VectorXd::Constant(rest.size(), weight);
  }

  FrameProblem Problem(const Camera& camera) const {
    FrameProblem problem;
    problem.reprojection = ReprojectionEnergy(camera, points, unit_per_px, robust_2d);
    problem.joint_positions = JointPositionEnergy(joints, positions, weight_3d);
    problem.bone_vectors = BoneVectorEnergy(bones, body_from_ray, bone_weights);
    problem.rest_prior = RestPriorEnergy(rest, rest_weights);
    return problem;
  }
};

// Detections of the 16 joints with white errors.
inline FrameIngredients MakeIngredients(const Skeleton& skeleton, const Camera& camera,
                                        const Eigen::VectorXd& pose, Terms terms, double noise_px,
                                        double noise_mm, std::mt19937* rng) {
  std::normal_distribution<double> normal;
  KinematicState state;
  ForwardKinematics(skeleton, pose, &state);
  FrameIngredients frame;
  const double mean = 1.0 / kNumPaperJoints;
  const bool paper = terms == Terms::kPaper;
  frame.unit_per_px = paper ? 1920.0 / std::max(camera.width, camera.height)
                            : 1000 * pose[2] * 2 / (camera.fx + camera.fy);
  frame.robust_2d = paper ? 0 : 100;
  Eigen::Matrix3Xd noisy = state.joints.leftCols<kNumPaperJoints>();
  for (int j = 0; j < kNumPaperJoints; ++j) {
    Observation2d point;
    point.joint = j;
    point.weight = mean;
    if (Project(camera, state.joints.col(j), &point.pixel)) {
      point.pixel += noise_px * Eigen::Vector2d(normal(*rng), normal(*rng));
      frame.points.push_back(point);
    }
    noisy.col(j) += noise_mm / 1000 * Eigen::Vector3d(normal(*rng), normal(*rng), normal(*rng));
  }
  if (paper) {
    for (int j = 0; j < kNumPaperJoints; ++j) frame.joints.push_back(j);
    frame.positions = noisy;
    frame.weight_3d = 0.1 * mean;
    return frame;
  }
  frame.body_from_ray = CameraFromRay(noisy.rowwise().mean());
  frame.bone_weights = {.across = std::sqrt(0.2), .along = std::sqrt(0.05), .robust_scale = 60};
  for (const JointPair& pair : StickFigure()) {
    const int a = static_cast<int>(pair.a);
    const int b = static_cast<int>(pair.b);
    frame.bones.push_back({a, b, noisy.col(b) - noisy.col(a), mean});
  }
  frame.SetRestPrior(skeleton, 30);
  return frame;
}

// Basis and weights of E_d: K = 8 and a hard subspace, or a soft band up to 4 Hz.
inline void SetSmoothness(Terms terms, double fps, BatchProblem* problem) {
  const int num_frames = static_cast<int>(problem->frames.size());
  const bool paper = terms == Terms::kPaper;
  const int size = paper ? 8 : BasisSize(num_frames, fps, 4);
  problem->basis = DctBasis(size, num_frames);
  const double weight = paper ? 50 : 0.2;
  problem->smoothness.setConstant(problem->skeleton.num_dofs(), weight * 600 * 600);
  problem->smoothness.head<3>().setConstant(weight * 1000 * 1000);
  problem->band_penalty.setZero(problem->smoothness.size(), problem->basis.rows());
  if (paper) return;
  for (int k = 0; k < size; ++k) {
    problem->band_penalty.col(k).setConstant(std::pow(static_cast<double>(k) / size, 4));
  }
}

struct SyntheticBatch {
  Camera camera = SyntheticCamera();
  std::vector<FrameIngredients> ingredients;
  BatchProblem problem;
  Eigen::MatrixXd truth;  // N x F
  Eigen::MatrixXd start;  // N x F: truth plus slow errors
};

// The batch of a motion given in the camera frame. rest_weight >= 0 replaces the rest prior's
// weight of the terms: the paper has none, which leaves some dofs free.
inline SyntheticBatch MakeBatch(const Eigen::MatrixXd& poses, double fps, Terms terms,
                                unsigned seed, double rest_weight = -1) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, 0.2);
  SyntheticBatch batch;
  batch.problem.skeleton = DefaultSkeleton();
  batch.truth = poses;
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    batch.ingredients.push_back(
        MakeIngredients(batch.problem.skeleton, batch.camera, poses.col(f), terms, 1, 10, &rng));
    if (rest_weight >= 0) {
      batch.ingredients.back().SetRestPrior(batch.problem.skeleton, rest_weight);
    }
    batch.problem.frames.push_back(batch.ingredients.back().Problem(batch.camera));
  }
  SetSmoothness(terms, fps, &batch.problem);
  Eigen::MatrixXd drift(poses.rows(), 4);
  for (double& x : drift.reshaped()) x = normal(rng);
  batch.start = poses + drift * DctBasis(4, static_cast<int>(poses.cols()));
  return batch;
}

}  // namespace mpc::testing
