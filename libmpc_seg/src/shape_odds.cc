#include "shape_odds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "mpc/seg/mask_bounds.h"

namespace mpc {
namespace {

constexpr double kMinPlaces = 20;
constexpr double kPriorPlaces = 10;  // with the whole outline's error, added to every neighbourhood
constexpr double kMinSigmaPx = 0.5;
constexpr double kGrossShare = 0.05;
constexpr double kCellsPerReach = 4;  // of the sums over a neighbourhood

// Standard deviation of a Gaussian whose mean absolute value is one.
const double kSigmaOfMean = std::sqrt(std::numbers::pi / 2);

// Log-odds that a pixel is inside an outline that lies z standard deviations from it, if that is
// where the outline is but for kGrossShare.
double OddsAt(double z) {
  const double inside = 0.5 * std::erfc(-z / std::numbers::sqrt2);
  return std::log((inside + kGrossShare) / (1 - inside + kGrossShare));
}

// A function of |z| up to six standard deviations, beyond which it stays as it is.
class Table {
 public:
  template <typename Function>
  explicit Table(const Function& function) {
    for (size_t i = 0; i < values_.size(); ++i) {
      values_[i] = static_cast<float>(function(static_cast<double>(i) / kPerSigma));
    }
  }
  float operator()(float z) const {
    const float at = std::min(std::abs(z) * kPerSigma, static_cast<float>(values_.size() - 2));
    const auto i = static_cast<size_t>(at);
    return values_[i] + (at - static_cast<float>(i)) * (values_[i + 1] - values_[i]);
  }

 private:
  static constexpr float kPerSigma = 64;
  std::array<float, 6 * 64 + 1> values_;
};

}  // namespace

cv::Mat1f Depth(const cv::Mat& mask) {
  cv::Mat1f depth(mask.size(), 0.F);
  const cv::Rect box = MaskBounds(mask);
  if (box.empty()) return depth;
  const cv::Rect around = Grown(box, 1, mask.size());
  cv::Mat1f near;
  cv::distanceTransform(mask(around), near, cv::DIST_L2, cv::DIST_MASK_5);
  near.copyTo(depth(around));
  return depth;
}

cv::Mat1f SignedDistance(const cv::Mat& mask) {
  cv::Mat1f inside = Depth(mask), outside;
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
    if (!is_sure.at<uint8_t>(a) || !is_sure.at<uint8_t>(b)) return;
    error(a / cell_px) += std::abs(distance(a) + distance(b)) / 2;
    count(a / cell_px) += 1;
  };
  for (int y = 0; y < labels.rows; ++y) {
    const uint8_t* row = labels.ptr(y);
    const uint8_t* below = labels.ptr(std::min(y + 1, labels.rows - 1));
    for (int x = 0; x < labels.cols; ++x) {
      if (x + 1 < labels.cols && row[x] != row[x + 1]) add({x, y}, {x + 1, y});
      if (row[x] != below[x]) add({x, y}, {x, y + 1});
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
  static const Table odds_at(OddsAt);
  cv::Mat1f odds(distance.size());
  for (int y = 0; y < odds.rows; ++y) {
    const float* d = distance[y];
    const float* p = precision[y];
    float* out = odds[y];
    for (int x = 0; x < odds.cols; ++x) out[x] = std::copysign(odds_at(d[x] * p[x]), d[x]);
  }
  return odds;
}

cv::Mat1f OutlineStrength(const cv::Mat1f& distance, const cv::Mat1f& precision, double discount,
                          double sharp_px) {
  static const Table gaussian([](double z) { return std::exp(-0.5 * z * z); });
  cv::Mat1f strength(distance.size());
  const auto most = static_cast<float>(discount), scale = static_cast<float>(sharp_px);
  for (int y = 0; y < strength.rows; ++y) {
    const float* d = distance[y];
    const float* p = precision[y];
    float* out = strength[y];
    for (int x = 0; x < strength.cols; ++x) {
      const float sharp = scale * p[x];
      out[x] = 1 - most * std::min(1.F, sharp * sharp) * gaussian(d[x] * p[x]);
    }
  }
  return strength;
}

}  // namespace mpc
