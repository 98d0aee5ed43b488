#include "shape_odds.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace mpc {
namespace {

constexpr double kMinPlaces = 20;
constexpr double kPriorPlaces = 10;  // with the whole outline's error, added to every neighbourhood
constexpr double kMinSigmaPx = 0.5;
constexpr double kGrossShare = 0.05;

// Standard deviation of a Gaussian whose mean absolute value is one.
const double kSigmaOfMean = std::sqrt(std::numbers::pi / 2);

}  // namespace

cv::Mat1f SignedDistance(const cv::Mat& mask) {
  cv::Mat1f inside, outside;
  cv::distanceTransform(mask, inside, cv::DIST_L2, cv::DIST_MASK_5);
  cv::distanceTransform(~mask, outside, cv::DIST_L2, cv::DIST_MASK_5);
  const auto far = static_cast<float>(mask.cols + mask.rows);  // where there is no other side
  for (int y = 0; y < mask.rows; ++y) {
    const uint8_t* is_inside = mask.ptr(y);
    float* in = inside[y];
    const float* out = outside[y];
    for (int x = 0; x < mask.cols; ++x) {
      in[x] = is_inside[x] ? std::min(in[x], far) - 0.5F : 0.5F - std::min(out[x], far);
    }
  }
  return inside;
}

cv::Mat1f MeasuredShapeOdds(const cv::Mat1f& distance, const cv::Mat& labels,
                            const cv::Mat& is_sure, double reach_px) {
  cv::Mat1f error(labels.size(), 0.F), count(labels.size(), 0.F);
  const auto add = [&](const cv::Point& a, const cv::Point& b) {
    if ((labels.at<uint8_t>(a) != 0) == (labels.at<uint8_t>(b) != 0)) return;
    if (!is_sure.at<uint8_t>(a) || !is_sure.at<uint8_t>(b)) return;
    error(a) += std::abs(distance(a) + distance(b)) / 2;
    count(a) += 1;
  };
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (x + 1 < labels.cols) add({x, y}, {x + 1, y});
      if (y + 1 < labels.rows) add({x, y}, {x, y + 1});
    }
  }
  cv::Mat1f odds(labels.size(), 0.F);
  const double total = cv::sum(count)[0];
  if (total < kMinPlaces) return odds;
  const double mean = cv::sum(error)[0] / total;
  cv::GaussianBlur(error, error, {}, reach_px, reach_px, cv::BORDER_CONSTANT);
  cv::GaussianBlur(count, count, {}, reach_px, reach_px, cv::BORDER_CONSTANT);
  const double prior = kPriorPlaces / (2 * std::numbers::pi * reach_px * reach_px);
  for (int y = 0; y < odds.rows; ++y) {
    for (int x = 0; x < odds.cols; ++x) {
      const double off = (error(y, x) + prior * mean) / (count(y, x) + prior);
      const double sigma = std::max(kSigmaOfMean * off, kMinSigmaPx);
      const double inside = 0.5 * std::erfc(-distance(y, x) / (sigma * std::numbers::sqrt2));
      odds(y, x) =
          static_cast<float>(std::log((inside + kGrossShare) / (1 - inside + kGrossShare)));
    }
  }
  return odds;
}

}  // namespace mpc
