// Purpose: where a person is in a picture: the turned square that the landmark network looks at.
// Source: MediaPipe's pose tracking; docs/detect.md. Units: pixels, radians.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace mpc {

struct PersonRegion {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();  // the hips
  double size_px = 0;                                // side of the square
  double rotation_rad = 0;  // of its x axis from the picture's, to its y axis

  // The square around a person whose hips are at `hips` and whose body, stretched out, would reach
  // to `reach`; upright when `reach` lies above `hips`.
  static PersonRegion Around(const Eigen::Vector2d& hips, const Eigen::Vector2d& reach);

  // The picture's point at (u, v) of the square, which goes from (0, 0) to (1, 1). Like everything
  // here with pixel centres at integers.
  Eigen::Vector2d PixelAt(const Eigen::Vector2d& uv) const;
};

// The square, resampled to side x side pixels; pixels outside of the picture repeat its border.
cv::Mat CropRegion(const cv::Mat& picture, const PersonRegion& region, int side);

// The inverse: a picture of the square (any size, one channel) in its place in a picture of `size`,
// 0 outside of the square.
cv::Mat PasteRegion(const cv::Mat& square, const PersonRegion& region, const cv::Size& size);

// The region at the share t of an even way from a to b; it turns the short way.
PersonRegion RegionBetween(const PersonRegion& a, const PersonRegion& b, double t);

// 0 for the same place and size; 1 when the centres are a side apart or the sizes differ e-fold.
double RegionDistance(const PersonRegion& a, const PersonRegion& b);

}  // namespace mpc
