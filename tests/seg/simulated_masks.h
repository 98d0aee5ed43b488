// Purpose: what a posed actor's masks look like when the pose is not quite right, made from a true
// mask: warped smoothly, shifted, grown or shrunk; and a thin skeleton inside of it.
// Units: pixels.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace mpc::testing {

struct MaskErrors {
  double warp_px = 12;     // largest displacement of the smooth warp
  double shift_px = 6;     // largest shift
  int grow_px = 4;         // largest erosion or dilation
  double skeleton_px = 3;  // largest shift of the skeleton against the mask
};

struct SimulatedMasks {
  cv::Mat model;  // CV_8U, 0 or 255
  cv::Mat skeleton;
};

inline double Uniform(std::mt19937* rng, double low, double high) {
  return low + (high - low) * static_cast<double>((*rng)()) / 4294967296.0;
}

// A shift of at most `reach` px in any direction.
inline cv::Point2d RandomShift(double reach, std::mt19937* rng) {
  const double angle = Uniform(rng, 0, 2 * std::numbers::pi);
  const double length = reach * std::sqrt(Uniform(rng, 0, 1));
  return {length * std::cos(angle), length * std::sin(angle)};
}

// Discs of a third of the local half-width along the ridges of the distance to the outline: thin
// limbs through the middle of the body.
inline cv::Mat ThinSkeleton(const cv::Mat& mask) {
  cv::Mat1f distance;
  cv::distanceTransform(mask, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::Mat skeleton(mask.size(), CV_8U, cv::Scalar(0));
  for (int y = 2; y + 2 < mask.rows; ++y) {
    for (int x = 2; x + 2 < mask.cols; ++x) {
      const float d = distance(y, x);
      if (d < 3) continue;
      // On a ridge, two opposite neighbours are both nearer to the outline.
      const bool ridge = (distance(y, x - 2) < d - 1 && distance(y, x + 2) < d - 1) ||
                         (distance(y - 2, x) < d - 1 && distance(y + 2, x) < d - 1) ||
                         (distance(y - 2, x - 2) < d - 1.4 && distance(y + 2, x + 2) < d - 1.4) ||
                         (distance(y - 2, x + 2) < d - 1.4 && distance(y + 2, x - 2) < d - 1.4);
      if (ridge)
        cv::circle(skeleton, {x, y}, std::max(1, static_cast<int>(d / 3)), 255, cv::FILLED);
    }
  }
  return skeleton;
}

inline SimulatedMasks SimulateMasks(const cv::Mat& truth, const MaskErrors& errors, uint32_t seed) {
  std::mt19937 rng(seed);
  // A coarse grid of random vectors, smoothly interpolated, one cell about a fifth of the body.
  const double size = std::sqrt(std::max(1, cv::countNonZero(truth)));
  const int columns = std::max(3, static_cast<int>(truth.cols / (0.6 * size)));
  const int rows = std::max(3, static_cast<int>(truth.rows / (0.6 * size)));
  cv::Mat2f grid(rows, columns);
  for (cv::Vec2f& v : grid) {
    const cv::Point2d d = RandomShift(1, &rng);
    v = {static_cast<float>(d.x), static_cast<float>(d.y)};
  }
  cv::Mat2f warp;
  cv::resize(grid, warp, truth.size(), 0, 0, cv::INTER_CUBIC);
  const cv::Rect body = cv::boundingRect(truth);
  double largest = 1e-6;
  for (int y = body.y; y < body.br().y; ++y) {
    for (int x = body.x; x < body.br().x; ++x) {
      largest = std::max(largest, cv::norm(warp(y, x)));
    }
  }
  const double scale = errors.warp_px * Uniform(&rng, 0.5, 1) / largest;
  const cv::Point2d shift = RandomShift(errors.shift_px, &rng);
  cv::Mat1f map_x(truth.size()), map_y(truth.size());
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      map_x(y, x) = static_cast<float>(x + shift.x + scale * warp(y, x)[0]);
      map_y(y, x) = static_cast<float>(y + shift.y + scale * warp(y, x)[1]);
    }
  }
  SimulatedMasks masks;
  cv::remap(truth, masks.model, map_x, map_y, cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  const int grow = static_cast<int>(std::lround(Uniform(&rng, -errors.grow_px, errors.grow_px)));
  const cv::Mat element = cv::getStructuringElement(
      cv::MORPH_ELLIPSE, {2 * std::abs(grow) + 1, 2 * std::abs(grow) + 1});
  if (grow > 0) cv::dilate(masks.model, masks.model, element);
  if (grow < 0) cv::erode(masks.model, masks.model, element);
  const cv::Point2d aside = RandomShift(errors.skeleton_px, &rng);
  const cv::Matx23d move(1, 0, aside.x, 0, 1, aside.y);
  cv::warpAffine(ThinSkeleton(masks.model), masks.skeleton, move, truth.size(), cv::INTER_NEAREST);
  masks.skeleton &= masks.model;
  return masks;
}

inline double MaskIou(const cv::Mat& a, const cv::Mat& b) {
  const int both = cv::countNonZero((a != 0) & (b != 0));
  const int any = cv::countNonZero((a != 0) | (b != 0));
  return any > 0 ? static_cast<double>(both) / any : 1;
}

}  // namespace mpc::testing
