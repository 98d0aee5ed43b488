#include "translation_fit.h"

#include <Eigen/Cholesky>

namespace mpc {

void TranslationFit::Add(const Eigen::Vector3d& x, const Eigen::Vector2d& m, double weight) {
  for (int axis = 0; axis < 2; ++axis) {
    // (x_axis + t_axis) - m_axis (x_z + t_z) = 0
    Eigen::Vector3d row = Eigen::Vector3d::Unit(axis);
    row.z() = -m[axis];
    a_ += weight * row * row.transpose();
    b_ += weight * row * (m[axis] * x.z() - x[axis]);
  }
}

Eigen::Vector3d TranslationFit::Solve() const { return a_.ldlt().solve(b_); }

}  // namespace mpc
