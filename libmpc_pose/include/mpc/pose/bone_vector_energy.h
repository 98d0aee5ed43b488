// Purpose: our 3D evidence: each bone's vector against the detected one, per axis of the viewing
// ray and robust per bone.
// Source: ours, in place of E_3d (docs/pose.md): networks err about twice as much along the ray as
// across it, and bone by bone, with a bias that lasts for seconds. Bone vectors do not see t_f.
// Rows: three per bone, mm: sqrt(weight) diag(across, across, along) R^T (J_b - J_a - vector).
#pragma once

#include <vector>

#include "mpc/pose/energy.h"

namespace mpc {

struct BoneObservation {
  int a = 0;  // indices into Skeleton::joints
  int b = 0;
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();  // from a to b, metres, body axes
  double weight = 1;
};

struct BoneVectorWeights {
  double across = 1;        // multiplies the residual across the ray (1/mm scale factor)
  double along = 1;         // and along it
  double robust_scale = 0;  // Geman-McClure c of the weighted residual, 0 for none
};

class BoneVectorEnergy {
 public:
  BoneVectorEnergy() = default;
  // body_from_ray: the viewing ray is its third column.
  BoneVectorEnergy(std::vector<BoneObservation> bones, const Eigen::Matrix3d& body_from_ray,
                   const BoneVectorWeights& weights);

  int num_residuals() const { return 3 * static_cast<int>(bones_.size()); }
  bool Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

  // The bones between some joints only: joint_index gives each joint's new index or -1.
  BoneVectorEnergy Restricted(const std::vector<int>& joint_index) const;

  const std::vector<BoneObservation>& bones() const { return bones_; }

 private:
  std::vector<BoneObservation> bones_;
  Eigen::Matrix3d metric_ = Eigen::Matrix3d::Identity();  // 1000 diag(...) R^T
  double robust_scale_ = 0;
};

}  // namespace mpc
