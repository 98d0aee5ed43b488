#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "mpc/core/error.h"
#include "mpc/eval/metrics.h"

namespace mpc {
namespace {

// 255 on the outline.
cv::Mat Outline(const cv::Mat& mask) {
  const cv::Mat inside = mask != 0;
  cv::Mat core;  // the whole neighbourhood is inside; beyond the picture counts as inside
  cv::erode(inside, core, cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}));
  return inside & ~core;
}

// Share of an outline that is near another one, neither of them empty.
double ShareNear(const cv::Mat& outline, const cv::Mat& other, double tolerance_px) {
  cv::Mat distance;
  cv::distanceTransform(~other, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const cv::Mat near = distance <= tolerance_px + 1e-3;
  return static_cast<double>(cv::countNonZero(outline & near)) / cv::countNonZero(outline);
}

}  // namespace

double BoundaryF(const cv::Mat& a, const cv::Mat& b, double tolerance_px) {
  if (a.size() != b.size() || a.type() != CV_8UC1 || b.type() != CV_8UC1) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("masks of {} x {} and {} x {} (8-bit, one channel expected)", a.cols,
                            a.rows, b.cols, b.rows));
  }
  if (!(tolerance_px > 0)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("the tolerance of an outline is {} px, not > 0", tolerance_px));
  }
  cv::Mat outline_a = Outline(a);
  cv::Mat outline_b = Outline(b);
  const cv::Rect box_a = cv::boundingRect(outline_a), box_b = cv::boundingRect(outline_b);
  const bool a_is_empty = box_a.empty(), b_is_empty = box_b.empty();
  if (a_is_empty || b_is_empty) return a_is_empty && b_is_empty ? 1 : 0;
  const cv::Rect both = box_a | box_b;  // distances between what lies in it need nothing else
  outline_a = outline_a(both).clone();
  outline_b = outline_b(both).clone();
  const double precision = ShareNear(outline_a, outline_b, tolerance_px);
  const double recall = ShareNear(outline_b, outline_a, tolerance_px);
  return precision + recall > 0 ? 2 * precision * recall / (precision + recall) : 0;
}

double BoundaryF(const cv::Mat& a, const cv::Mat& b) {
  return BoundaryF(a, b, std::max(1.0, std::ceil(0.008 * std::hypot(a.cols, a.rows))));
}

}  // namespace mpc
