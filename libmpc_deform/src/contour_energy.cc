#include "mpc/deform/contour_energy.h"

#include <algorithm>
#include <cmath>

namespace mpc {

ContourEnergy::ContourEnergy(const Camera& camera, const Correspondences& correspondences,
                             double robust_px)
    : camera_(&camera),
      correspondences_(&correspondences),
      scale_(1920.0 / std::max(camera.width, camera.height)),
      robust_px_(robust_px) {}

bool ContourEnergy::Evaluate(const RefinementPoint& at, int first_row, Eigen::VectorXd* r,
                             Eigen::MatrixXd* jacobian) const {
  const Correspondences& all = *correspondences_;
  for (int k = 0; k < all.size(); ++k) {
    const int vertex = all.vertices[static_cast<size_t>(k)];
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> pixel_jacobian;
    if (!Project(*camera_, at.skinner.Position(vertex), &pixel, &pixel_jacobian)) return false;
    const Eigen::Vector2d normal = all.normals.col(k);
    // Eq. 11
    const double distance = scale_ * normal.dot(pixel - all.targets.col(k));
    const double sqrt_weight = std::sqrt(all.weights[k] / all.num_boundary);
    // Geman-McClure as a map of the residual: its square becomes rho.
    const double q = robust_px_ > 0 ? 1 / (1 + distance * distance / (robust_px_ * robust_px_)) : 1;
    (*r)[first_row + k] = sqrt_weight * std::sqrt(q) * distance;
    if (jacobian == nullptr) continue;
    const double slope = sqrt_weight * q * std::sqrt(q) * scale_;
    at.skinner.Derivative(vertex, slope * pixel_jacobian.transpose() * normal,
                          jacobian->col(first_row + k));
  }
  return true;
}

}  // namespace mpc
