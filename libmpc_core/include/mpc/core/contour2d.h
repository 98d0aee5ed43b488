// Purpose: a silhouette outline: points with outward normals, and the paper's correspondence
// search (Section 5.2: closest point with a similar normal).
// Units: pixels, pixel centres at integers. Symbols: P points.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace mpc {

struct Contour2d {
  Eigen::Matrix2Xd points;   // 2xP
  Eigen::Matrix2Xd normals;  // 2xP, unit, pointing out of the silhouette
};

// Answers "nearest point with a similar normal" on a uniform grid. Immutable after construction and
// safe to query from several threads.
class ContourIndex {
 public:
  // cell_px: side of a grid cell, > 0. Throws Error when points and normals differ in number.
  explicit ContourIndex(const Contour2d& contour, double cell_px = 8);

  // Index of the closest contour point within max_distance_px whose normal makes an angle of at
  // most acos(min_cos) with `normal`, or -1. Ties go to the lowest index.
  int Nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& normal, double max_distance_px,
              double min_cos) const;

  const Contour2d& contour() const { return contour_; }

 private:
  Contour2d contour_;
  double cell_px_;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  int columns_ = 0;
  int rows_ = 0;
  std::vector<int> cell_begin_;  // columns_*rows_ + 1
  std::vector<int> order_;       // point indices grouped by cell
};

}  // namespace mpc
