// Purpose: ties a frame's pose to its neighbour's while frames are solved one after the other.
// Source: ours; only the initialisation uses it, E_d couples the frames of a batch.
// Rows: 3 sqrt(w_t) (t - t_0), 3 sqrt(w_a) log(R R_0^T), one sqrt(w_a) (theta - theta_0) per hinge.
// Units: weights per m^2 and per rad^2.
#pragma once

#include "mpc/pose/energy.h"

namespace mpc {

class TrackPriorEnergy {
 public:
  TrackPriorEnergy() = default;
  // pose: N, the neighbour's.
  TrackPriorEnergy(const Eigen::VectorXd& pose, double translation_weight, double angle_weight);

  int num_residuals() const { return static_cast<int>(pose_.size()); }
  bool Evaluate(const PosePoint& at, int first_row, Eigen::VectorXd* r,
                Eigen::MatrixXd* jacobian) const;

 private:
  Eigen::VectorXd pose_;
  Eigen::Matrix3d rotation_ = Eigen::Matrix3d::Identity();
  double translation_scale_ = 0;
  double angle_scale_ = 0;
};

}  // namespace mpc
