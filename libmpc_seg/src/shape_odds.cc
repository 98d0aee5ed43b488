#include "shape_odds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace mpc {
namespace {

constexpr double kMinPlaces = 20;
constexpr double kPriorPlaces = 10;  // with the whole outline's error, added to every neighbourhood
constexpr double kMinSigmaPx = 0.5;
constexpr double kGrossShare = 0.05;
constexpr double kFarSquared = 36;  // in sigma^2: a Gaussian is less than a float's rounding there
constexpr double kCellsPerReach = 4;  // of the sums over a neighbourhood

// Standard deviation of a Gaussian whose mean absolute value is one.
const double kSigmaOfMean = std::sqrt(std::numbers::pi / 2);

// Log-odds that a pixel is inside an outline that lies z standard deviations from it, if that is
// where the outline is but for kGrossShare.
class OddsTable {
 public:
  OddsTable() {
    for (size_t i = 0; i < values_.size(); ++i) {
      const double z = static_cast<double>(i) / kPerSigma;
      const double inside = 0.5 * std::erfc(-z / std::numbers::sqrt2);
      values_[i] =
          static_cast<float>(std::log((inside + kGrossShare) / (1 - inside + kGrossShare)));
    }
  }
  float operator()(float z) const {
    const float at = std::min(std::abs(z) * kPerSigma, static_cast<float>(values_.size() - 2));
    const auto i = static_cast<size_t>(at);
    const float odds = values_[i] + (at - static_cast<float>(i)) * (values_[i + 1] - values_[i]);
    return z < 0 ? -odds : odds;
  }

 private:
  static constexpr float kPerSigma = 64;
  std::array<float, 6 * 64 + 1> values_;
};

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

cv::Mat1f MeasurePrecision(const cv::Mat1f& distance, const cv::Mat& labels, const cv::Mat& is_sure,
                           double reach_px) {
  // Sums over cells, a few per reach.
  const int cell_px = std::max(1, static_cast<int>(reach_px / kCellsPerReach));
  const cv::Size cells((labels.cols + cell_px - 1) / cell_px,
                       (labels.rows + cell_px - 1) / cell_px);
  cv::Mat1f error(cells, 0.F), count(cells, 0.F);
  const auto add = [&](const cv::Point& a, const cv::Point& b) {
    if ((labels.at<uint8_t>(a) != 0) == (labels.at<uint8_t>(b) != 0)) return;
    if (!is_sure.at<uint8_t>(a) || !is_sure.at<uint8_t>(b)) return;
    error(a / cell_px) += std::abs(distance(a) + distance(b)) / 2;
    count(a / cell_px) += 1;
  };
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (x + 1 < labels.cols) add({x, y}, {x + 1, y});
      if (y + 1 < labels.rows) add({x, y}, {x, y + 1});
    }
  }
  const double total = cv::sum(count)[0];
  if (total < kMinPlaces) return cv::Mat1f(labels.size(), 0.F);
  const double mean = cv::sum(error)[0] / total;
  const double reach = reach_px / cell_px;
  cv::GaussianBlur(error, error, {}, reach, reach, cv::BORDER_CONSTANT);
  cv::GaussianBlur(count, count, {}, reach, reach, cv::BORDER_CONSTANT);
  const double prior = kPriorPlaces / (2 * std::numbers::pi * reach * reach);
  cv::Mat1f precision(cells);
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      const double off = (error(y, x) + prior * mean) / (count(y, x) + prior);
      precision(y, x) = static_cast<float>(1 / std::max(kSigmaOfMean * off, kMinSigmaPx));
    }
  }
  cv::resize(precision, precision, {}, cell_px, cell_px, cv::INTER_LINEAR);
  return precision(cv::Rect({}, labels.size()));
}

cv::Mat1f OutlineOdds(const cv::Mat1f& distance, const cv::Mat1f& precision) {
  static const OddsTable odds_at;
  cv::Mat1f odds(distance.size());
  for (int y = 0; y < odds.rows; ++y) {
    for (int x = 0; x < odds.cols; ++x) odds(y, x) = odds_at(distance(y, x) * precision(y, x));
  }
  return odds;
}

cv::Mat1f OutlineStrength(const cv::Mat1f& distance, const cv::Mat1f& precision, double discount,
                          double sharp_px) {
  cv::Mat1f strength(distance.size());
  for (int y = 0; y < strength.rows; ++y) {
    for (int x = 0; x < strength.cols; ++x) {
      const double z = distance(y, x) * precision(y, x), sharp = sharp_px * precision(y, x);
      strength(y, x) = z * z > kFarSquared
                           ? 1
                           : static_cast<float>(1 - discount * std::min(1.0, sharp * sharp) *
                                                        std::exp(-0.5 * z * z));
    }
  }
  return strength;
}

}  // namespace mpc
