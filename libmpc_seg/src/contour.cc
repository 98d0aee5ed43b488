#include "mpc/seg/contour.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/seg/mask_bounds.h"
#include "picture.h"
#include "pixel_block.h"

namespace mpc {
namespace {

constexpr double kSmoothPx = 2;  // sigma of the smoothing of a mask; ours
constexpr double kAlongPx = 3;   // step of the second derivative along the outline
constexpr int kMargin = 8;       // px around the mask that the smoothing needs
constexpr double kMaxShiftPx = 1;

// Value and gradient of a picture at (x, y), bilinear, the border repeated.
float Value(const cv::Mat1f& f, float x, float y) {
  const float cx = std::clamp(x, 0.F, static_cast<float>(f.cols - 1));
  const float cy = std::clamp(y, 0.F, static_cast<float>(f.rows - 1));
  const int x0 = std::min(static_cast<int>(cx), std::max(0, f.cols - 2));
  const int y0 = std::min(static_cast<int>(cy), std::max(0, f.rows - 2));
  const int x1 = std::min(x0 + 1, f.cols - 1);
  const int y1 = std::min(y0 + 1, f.rows - 1);
  const float u = cx - static_cast<float>(x0);
  const float v = cy - static_cast<float>(y0);
  return (1 - v) * ((1 - u) * f(y0, x0) + u * f(y0, x1)) +
         v * ((1 - u) * f(y1, x0) + u * f(y1, x1));
}

}  // namespace

Contour2d ExtractContour(const cv::Mat& mask, const cv::Mat& soft) {
  CheckMask(mask, mask.size(), "mask");
  cv::Mat soft_field = soft;
  if (!soft.empty() && soft.type() == CV_32FC1 && soft.size() == mask.size()) {
    // as it is
  } else if (!soft.empty()) {
    CheckMask(soft, mask.size(), "soft mask");
    soft.convertTo(soft_field, CV_32F, 1.0 / 255);
  }
  Contour2d contour;
  const cv::Rect box = MaskBounds(mask);
  if (box.empty()) return contour;
  const cv::Rect area = Grown(box, kMargin, mask.size());
  const cv::Mat inside = mask(area) != 0;
  cv::Mat1f field;
  const cv::Mat source = soft_field.empty() ? inside : soft_field(area);
  source.convertTo(field, CV_32F, soft_field.empty() ? 1.0 / 255 : 1.0);
  if (soft_field.empty()) {
    cv::GaussianBlur(field, field, {}, kSmoothPx, kSmoothPx,
                     cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
  }

  std::vector<Eigen::Vector2d> points;
  std::vector<Eigen::Vector2d> normals;
  // (x, y) and its neighbour (x + dx, y + dy) lie on different sides.
  const auto add = [&](int x, int y, int dx, int dy) {
    const float mx = static_cast<float>(x) + 0.5F * static_cast<float>(dx);
    const float my = static_cast<float>(y) + 0.5F * static_cast<float>(dy);
    const Eigen::Vector2d gradient(Value(field, mx + 1, my) - Value(field, mx - 1, my),
                                   Value(field, mx, my + 1) - Value(field, mx, my - 1));
    const Eigen::Vector2d across =
        inside.ptr(y)[x] ? Eigen::Vector2d(dx, dy) : Eigen::Vector2d(-dx, -dy);  // outwards
    Eigen::Vector2d point(mx, my);
    Eigen::Vector2d normal = across;
    const double slope = gradient.norm() / 2;  // per px
    if (slope > 0.05 && gradient.dot(across) < slope) {
      normal = -gradient.normalized();
      // Smoothing moves a curved outline inwards; the second derivative along it says how much.
      const auto tx = static_cast<float>(-kAlongPx * normal.y());
      const auto ty = static_cast<float>(kAlongPx * normal.x());
      const double value = Value(field, mx, my);
      const double along =
          (Value(field, mx + tx, my + ty) + Value(field, mx - tx, my - ty) - 2 * value) /
          (kAlongPx * kAlongPx);
      const double excess = value - 0.5 - (soft.empty() ? 0.5 * kSmoothPx * kSmoothPx * along : 0);
      point += std::clamp(excess / slope, -kMaxShiftPx, kMaxShiftPx) * normal;
    }
    points.push_back(point + Eigen::Vector2d(area.x, area.y));
    normals.push_back(normal);
  };
  for (int y = 0; y < area.height; ++y) {
    const uint8_t* row = inside.ptr(y);
    const uint8_t* below = y + 1 < area.height ? inside.ptr(y + 1) : row;
    for (int x = 0; x < area.width; ++x) {
      if (x + kBlock < area.width && Block(row + x) == Block(row + x + 1) &&
          Block(row + x) == Block(below + x)) {
        x += kBlock - 1;
        continue;
      }
      if (x + 1 < area.width && row[x] != row[x + 1]) add(x, y, 1, 0);
      if (row[x] != below[x]) add(x, y, 0, 1);
    }
  }
  contour.points.resize(2, static_cast<Eigen::Index>(points.size()));
  contour.normals.resize(2, static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) {
    contour.points.col(static_cast<Eigen::Index>(i)) = points[i];
    contour.normals.col(static_cast<Eigen::Index>(i)) = normals[i];
  }
  return contour;
}

}  // namespace mpc
