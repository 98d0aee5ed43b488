#include "mpc/pose/energy.h"

#include <cmath>

namespace mpc {

void PosePoint::Update(const Skeleton& skeleton, bool with_jacobian) {
  ForwardKinematics(skeleton, pose, root_rotation, &state);
  if (with_jacobian) JointJacobian(skeleton, state, &joint_jacobian);
}

void ApplyRobustLoss(double c, int first_row, int size, Eigen::VectorXd* r,
                     Eigen::MatrixXd* jacobian) {
  if (c <= 0) return;
  auto block = r->segment(first_row, size);
  const double q = 1 / (1 + block.squaredNorm() / (c * c));
  const double scale = std::sqrt(q);
  if (jacobian != nullptr) {
    // d (s r) = s (I - q r r^T / c^2) dr with s = q^(1/2).
    auto rows = jacobian->middleRows(first_row, size);
    for (int n = 0; n < rows.cols(); ++n) {
      const double along = block.dot(rows.col(n)) * q / (c * c);
      rows.col(n) = scale * (rows.col(n) - along * block);
    }
  }
  block *= scale;
}

}  // namespace mpc
