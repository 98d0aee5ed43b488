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

}  // namespace mpc
