// Purpose: an actor in tight clothes before a camera, its silhouettes, and how far a pose is from the truth.
// Frames: camera frame. Units: metres, errors mm.
#pragma once

#include <Eigen/Core>
#include <numbers>
#include <opencv2/core.hpp>
#include <random>

#include "mpc/core/rigid.h"
#include "mpc/deform/correspondences.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/eval/metrics.h"
#include "mpc/eval/motions.h"
#include "mpc/render/model_mask.h"
#include "mpc/seg/contour.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_map.h"
#include "mpc/skeleton/skinning.h"

namespace mpc::testing {

inline const Character& Actor() {
  static const Character character = [] {
    const RigAsset rig = MakeDressedActor({.outfit = Outfit::kTight}).rig;
    return BuildCharacter(rig, MapRigByNames(rig));
  }();
  return character;
}

inline Camera Camera1080() { return Camera::FromFov(1920, 1080, 1.0); }

// A motion seen upright from 4 m away, turned about the vertical.
inline Eigen::MatrixXd MotionInCamera(MotionKind kind, double seconds, double fps,
                                      double turn_rad = 0) {
  const Eigen::Matrix3d turn = ExpSO3({0, turn_rad, 0});
  const Eigen::MatrixXd motion = TransformPoses(turn, Eigen::Vector3d::Zero(),
                                                MakeMotion(Actor().skeleton, kind, seconds, fps));
  return TransformPoses(ExpSO3({std::numbers::pi, 0, 0}), {0.1, 0.9, 4}, motion);
}

inline Eigen::VectorXd MidWalk(double turn_rad = 0.7) {
  return MotionInCamera(MotionKind::kWalk, 1, 30, turn_rad).col(9);
}

// Off by some degrees and centimetres, within the bounds.
inline Eigen::VectorXd Perturbed(const Eigen::VectorXd& pose, unsigned seed, double angle = 0.08,
                                 double metres = 0.02) {
  const Skeleton& skeleton = Actor().skeleton;
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd moved = pose;
  for (int n = 0; n < moved.size(); ++n) moved[n] += (n < 3 ? metres : angle) * normal(rng);
  return moved.cwiseMax(skeleton.LowerBounds()).cwiseMin(skeleton.UpperBounds());
}

inline Eigen::Matrix3Xf Vertices(const Character& character, const Eigen::VectorXd& pose) {
  KinematicState state;
  ForwardKinematics(character.skeleton, pose, &state);
  Eigen::Matrix3Xf vertices;
  SkinCharacter(character, state, &vertices);
  return vertices;
}

inline cv::Mat MaskOf(const Camera& camera, const Character& character,
                      const Eigen::VectorXd& pose) {
  cv::Mat mask;
  ModelMask(camera, Vertices(character, pose), SurfaceTopology::FromMesh(character.mesh), &mask);
  return mask;
}

inline Contour2d SilhouetteOf(const Camera& camera, const Character& character,
                              const Eigen::VectorXd& pose) {
  return ExtractContour(MaskOf(camera, character, pose));
}

inline double Iou(const Camera& camera, const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return MaskIou(MaskOf(camera, Actor(), a), MaskOf(camera, Actor(), b));
}

// Mean distance of the 16 joints.
inline double JointErrorMm(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  KinematicState x, y;
  ForwardKinematics(Actor().skeleton, a, &x);
  ForwardKinematics(Actor().skeleton, b, &y);
  return 1000 * (x.joints - y.joints).leftCols<kNumPaperJoints>().colwise().norm().mean();
}

// The points of a contour for which keep(point) holds.
template <typename Keep>
Contour2d Filtered(const Contour2d& contour, const Keep& keep) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < contour.points.cols(); ++i) {
    if (keep(Eigen::Vector2d(contour.points.col(i)))) kept.push_back(i);
  }
  return {contour.points(Eigen::all, kept), contour.normals(Eigen::all, kept)};
}

inline Eigen::Vector2d PixelOf(const Camera& camera, const Eigen::Vector3d& x) {
  Eigen::Vector2d pixel(-1, -1);
  Project(camera, x, &pixel);
  return pixel;
}

}  // namespace mpc::testing
