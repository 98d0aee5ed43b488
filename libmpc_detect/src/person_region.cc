#include "mpc/detect/person_region.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "warp.h"

namespace mpc {
namespace {

constexpr double kMargin = 1.25;  // of the square around the circle through head and feet

// picture_from_square for pixels of a square of `side`.
cv::Matx23d PictureFromSquare(const PersonRegion& region, int side) {
  const double scale = region.size_px / side;
  const double c = scale * std::cos(region.rotation_rad);
  const double s = scale * std::sin(region.rotation_rad);
  const Eigen::Vector2d origin = region.PixelAt({0.5 / side, 0.5 / side});
  return {c, -s, origin.x(), s, c, origin.y()};
}

}  // namespace

PersonRegion PersonRegion::Around(const Eigen::Vector2d& hips, const Eigen::Vector2d& reach) {
  const Eigen::Vector2d up = reach - hips;
  return {.center = hips,
          .size_px = 2 * kMargin * up.norm(),
          .rotation_rad = std::remainder(std::numbers::pi / 2 + std::atan2(up.y(), up.x()),
                                         2 * std::numbers::pi)};
}

Eigen::Vector2d PersonRegion::PixelAt(const Eigen::Vector2d& uv) const {
  const Eigen::Vector2d from_center = size_px * (uv - Eigen::Vector2d(0.5, 0.5));
  return center + Eigen::Rotation2Dd(rotation_rad) * from_center;
}

cv::Mat CropRegion(const cv::Mat& picture, const PersonRegion& region, int side) {
  return internal::WarpToSquare(picture, PictureFromSquare(region, side), side,
                                cv::BORDER_REPLICATE);
}

cv::Mat PasteRegion(const cv::Mat& square, const PersonRegion& region, const cv::Size& size) {
  cv::Mat picture;
  cv::warpAffine(square, picture, PictureFromSquare(region, square.cols), size, cv::INTER_LINEAR,
                 cv::BORDER_CONSTANT, 0);
  return picture;
}

PersonRegion RegionBetween(const PersonRegion& a, const PersonRegion& b, double t) {
  const double turn = std::remainder(b.rotation_rad - a.rotation_rad, 2 * std::numbers::pi);
  return {.center = (1 - t) * a.center + t * b.center,
          .size_px = std::pow(a.size_px, 1 - t) * std::pow(b.size_px, t),
          .rotation_rad = a.rotation_rad + t * turn};
}

double RegionDistance(const PersonRegion& a, const PersonRegion& b) {
  const double apart = (a.center - b.center).norm() / std::sqrt(a.size_px * b.size_px);
  return std::max(apart, std::abs(std::log(a.size_px / b.size_px)));
}

}  // namespace mpc
