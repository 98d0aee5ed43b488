// Purpose: E_2d, joints projected onto their 2D detections.
// Source: paper, Section 4, E_2d; confidence weights, robust loss and the unit are ours.
// Rows: two per observation: sqrt(weight) unit_per_px (Pi(J_i) - d_i), robust per observation.
#pragma once

#include <vector>

#include "mpc/core/camera.h"
#include "mpc/pose/energy.h"

namespace mpc {

struct Observation2d {
  int joint = 0;  // index into Skeleton::joints
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double weight = 1;      // >= 0
  double confidence = 1;  // the detector's own, for reports
};

class ReprojectionEnergy {
 public:
  ReprojectionEnergy() = default;
  // unit_per_px turns pixels into the unit of the energy: 1920 / long side of the frame, or
  // millimetres per pixel at the person. robust_scale: Geman-McClure c in that unit, 0 for none.
  ReprojectionEnergy(const Camera& camera, std::vector<Observation2d> observations,
                     double unit_per_px, double robust_scale);

  int num_residuals() const { return 2 * static_cast<int>(observations_.size()); }
  // False when a joint does not project (behind the camera).
  bool Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

  // The observations of some joints only: joint_index gives each joint's new index or -1.
  ReprojectionEnergy Restricted(const std::vector<int>& joint_index) const;

  const std::vector<Observation2d>& observations() const { return observations_; }
  double unit_per_px() const { return unit_per_px_; }

 private:
  Camera camera_;
  std::vector<Observation2d> observations_;
  double unit_per_px_ = 1;
  double robust_scale_ = 0;
};

}  // namespace mpc
