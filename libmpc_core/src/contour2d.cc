#include "mpc/core/contour2d.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mpc/core/error.h"

namespace mpc {

ContourIndex::ContourIndex(const Contour2d& contour, double cell_px)
    : contour_(contour), cell_px_(cell_px) {
  const Eigen::Index num_points = contour.points.cols();
  if (num_points != contour.normals.cols()) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("contour: {} points but {} normals",
                                                         num_points, contour.normals.cols()));
  }
  if (!contour.points.allFinite() || !contour.normals.allFinite()) {
    throw Error(ErrorCode::kInvalidArgument, "contour: a point or normal is not finite");
  }
  if (!(cell_px > 0 && std::isfinite(cell_px))) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("contour: cell size {} px, expected a positive number", cell_px));
  }
  if (num_points == 0) return;

  origin_ = contour.points.rowwise().minCoeff();
  const Eigen::Vector2d extent = contour.points.rowwise().maxCoeff() - origin_;
  // Points far apart get larger cells, so that memory depends on their number only.
  const double max_cells = 1024 + 4 * static_cast<double>(num_points);
  while ((extent.x() / cell_px_ + 1) * (extent.y() / cell_px_ + 1) > max_cells) cell_px_ *= 2;
  columns_ = static_cast<int>(extent.x() / cell_px_) + 1;
  rows_ = static_cast<int>(extent.y() / cell_px_) + 1;

  const auto cell_of = [&](Eigen::Index i) {
    const Eigen::Vector2i cell = ((contour_.points.col(i) - origin_) / cell_px_).cast<int>();
    return static_cast<size_t>(cell.y() * columns_ + cell.x());
  };
  cell_begin_.assign(static_cast<size_t>(columns_ * rows_) + 1, 0);
  for (Eigen::Index i = 0; i < num_points; ++i) ++cell_begin_[cell_of(i) + 1];
  for (size_t c = 1; c < cell_begin_.size(); ++c) cell_begin_[c] += cell_begin_[c - 1];
  order_.resize(static_cast<size_t>(num_points));
  std::vector<int> end = cell_begin_;
  for (int i = 0; i < num_points; ++i) order_[static_cast<size_t>(end[cell_of(i)]++)] = i;
}

int ContourIndex::Nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& normal,
                          double max_distance_px, double min_cos) const {
  if (order_.empty() || !point.allFinite() || !(max_distance_px >= 0)) return -1;

  // Search rings of cells around `inside`, the point of the grid's rectangle nearest to `point`.
  const Eigen::Vector2d corner = origin_ + cell_px_ * Eigen::Vector2d(columns_, rows_);
  const Eigen::Vector2d inside = point.cwiseMax(origin_).cwiseMin(corner);
  const double outside_sq = (point - inside).squaredNorm();
  const int column =
      std::min(static_cast<int>((inside.x() - origin_.x()) / cell_px_), columns_ - 1);
  const int row = std::min(static_cast<int>((inside.y() - origin_.y()) / cell_px_), rows_ - 1);

  int best = -1;
  double best_sq = max_distance_px * max_distance_px;
  const auto search = [&](int r, int c) {
    const size_t cell = static_cast<size_t>(r * columns_ + c);
    for (int k = cell_begin_[cell]; k < cell_begin_[cell + 1]; ++k) {
      const int i = order_[static_cast<size_t>(k)];
      const double distance_sq = (contour_.points.col(i) - point).squaredNorm();
      const bool closer = best < 0 ? distance_sq <= best_sq
                                   : distance_sq < best_sq || (distance_sq == best_sq && i < best);
      if (closer && contour_.normals.col(i).dot(normal) >= min_cos) {
        best = i;
        best_sq = distance_sq;
      }
    }
  };
  const int last_ring = std::max({column, columns_ - 1 - column, row, rows_ - 1 - row});
  for (int ring = 0; ring <= last_ring; ++ring) {
    const double gap = std::max(0, ring - 1) * cell_px_;
    if (outside_sq + gap * gap > best_sq) break;
    const int c_min = std::max(0, column - ring), c_max = std::min(columns_ - 1, column + ring);
    for (int r = std::max(0, row - ring); r <= std::min(rows_ - 1, row + ring); ++r) {
      if (std::abs(r - row) == ring) {
        for (int c = c_min; c <= c_max; ++c) search(r, c);
      } else {
        if (column - ring >= 0) search(r, column - ring);
        if (column + ring < columns_) search(r, column + ring);
      }
    }
  }
  return best;
}

}  // namespace mpc
