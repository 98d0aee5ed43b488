#include "mpc/pose/trajectory_basis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mpc/core/error.h"

namespace mpc {
namespace {

// Rows [first, first + count) of the orthonormal DCT-II matrix of size F.
Eigen::MatrixXd DctRows(int first, int count, int num_frames) {
  Eigen::MatrixXd rows(count, num_frames);
  for (int r = 0; r < count; ++r) {
    const int k = first + r;
    const double scale = std::sqrt((k == 0 ? 1.0 : 2.0) / num_frames);
    for (int f = 0; f < num_frames; ++f) {
      rows(r, f) = scale * std::cos(std::numbers::pi * k * (2 * f + 1) / (2.0 * num_frames));
    }
  }
  return rows;
}

}  // namespace

Eigen::MatrixXd DctBasis(int num_vectors, int num_frames) {
  if (num_frames < 1) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("a trajectory basis needs at least one frame, got {}", num_frames));
  }
  return DctRows(0, std::clamp(num_vectors, 1, num_frames), num_frames);
}

int BasisSize(int num_frames, double fps, double cutoff_hz) {
  const double size = 1 + 2.0 * num_frames * cutoff_hz / fps;
  return std::clamp(static_cast<int>(std::lround(std::min(size, 1.0 * num_frames))),
                    std::min(2, num_frames), num_frames);
}

Eigen::MatrixXd BasisComplement(const Eigen::MatrixXd& basis) {
  const int num_frames = static_cast<int>(basis.cols());
  const int num_vectors = static_cast<int>(basis.rows());
  return DctRows(num_vectors, num_frames - num_vectors, num_frames);
}

Eigen::MatrixXd AdaptedShares(const Eigen::MatrixXd& coefficients, const Eigen::VectorXd& weights,
                              double noise_cost, double max_share) {
  constexpr int kHalfWidth = 2;  // in k
  const int num_basis = static_cast<int>(coefficients.cols());
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(coefficients.rows(), num_basis);
  for (int k = 1; k < num_basis; ++k) {
    const int first = std::max(1, k - kHalfWidth);
    const int last = std::min(num_basis - 1, k + kHalfWidth);
    const auto band = coefficients.middleCols(first, last - first + 1);
    for (int n = 0; n < coefficients.rows(); ++n) {
      const double variance = band.row(n).squaredNorm() / static_cast<double>(band.cols());
      // A Gaussian prior's cost is noise_cost C^2 / variance; the share is of weights_n C^2.
      shares(n, k) = std::min(max_share, noise_cost / std::max(1e-300, weights[n] * variance));
    }
  }
  return shares;
}

}  // namespace mpc
