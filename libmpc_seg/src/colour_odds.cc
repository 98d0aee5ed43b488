#include "colour_odds.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

namespace mpc {
namespace {

constexpr float kUnset = 1e30F;
constexpr double kRareShare = 0.003;  // of pixels, added to every bin of the changes; ours

}  // namespace

ColourOdds::ColourOdds(const ColourModel& actor, const ColourModel& background,
                       double outlier_share, bool exact)
    : actor_(actor),
      background_(background),
      outlier_density_(static_cast<float>(outlier_share / (1 - outlier_share) / (1 << 24))) {
  if (!exact) table_.assign(1 << 18, kUnset);
}

float ColourOdds::operator()(const uint8_t* bgr) {
  if (table_.empty()) {
    return Evaluate(
        {static_cast<float>(bgr[0]), static_cast<float>(bgr[1]), static_cast<float>(bgr[2])});
  }
  float& value =
      table_[static_cast<size_t>((bgr[0] >> 2) << 12 | (bgr[1] >> 2) << 6 | bgr[2] >> 2)];
  if (value == kUnset) {
    const auto centre = [](uint8_t c) { return static_cast<float>(c & ~3) + 1.5F; };
    value = Evaluate({centre(bgr[0]), centre(bgr[1]), centre(bgr[2])});
  }
  return value;
}

float ColourOdds::Evaluate(const Eigen::Vector3f& bgr) const {
  const float actor = actor_.NegLogLikelihood(bgr);
  const float background = background_.NegLogLikelihood(bgr);
  if (outlier_density_ == 0) return background - actor;
  return std::log((std::exp(-actor) + outlier_density_) /
                  (std::exp(-background) + outlier_density_));
}

std::vector<WeightedColour> CollectColours(const cv::Mat& bgr, const cv::Mat& mask,
                                           int max_colours) {
  const int step = 1 + cv::countNonZero(mask) / max_colours;
  std::vector<WeightedColour> colours;
  int skip = 0;
  for (int y = 0; y < mask.rows; ++y) {
    const uint8_t* row = mask.ptr(y);
    const uint8_t* c = bgr.ptr(y);
    for (int x = 0; x < mask.cols; ++x, c += 3) {
      if (row[x] == 0 || --skip >= 0) continue;
      skip = step - 1;
      colours.push_back(
          {{static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])}});
    }
  }
  return colours;
}

size_t StillnessOdds::Bin(uint16_t change) {
  const unsigned c = change + 1U;
  const int octave = std::bit_width(c) - 1;
  const unsigned half = octave > 0 ? (c >> (octave - 1)) & 1U : 0;  // upper half of the octave
  return std::min<size_t>(2 * static_cast<size_t>(octave) + half, kBins - 1);
}

StillnessOdds::StillnessOdds(const cv::Mat& change, const cv::Mat& actor,
                             const cv::Mat& background) {
  std::array<double, kBins> actor_count{}, background_count{};
  for (int y = 0; y < change.rows; ++y) {
    const uint16_t* row = change.ptr<uint16_t>(y);
    for (int x = 0; x < change.cols; ++x) {
      if (actor.ptr(y)[x]) ++actor_count[Bin(row[x])];
      if (background.ptr(y)[x]) ++background_count[Bin(row[x])];
    }
  }
  // Share of the pixels in and around a bin: a triangle of five.
  const auto share = [](const std::array<double, kBins>& count, int bin) {
    double near = 0, total = 0;
    for (int i = 0; i < kBins; ++i) {
      near += std::max(0, 3 - std::abs(i - bin)) / 9.0 * count[static_cast<size_t>(i)];
      total += count[static_cast<size_t>(i)];
    }
    return near / std::max(total, 1.0) + kRareShare;
  };
  for (int bin = 0; bin < kBins; ++bin) {
    const double odds = std::log(share(actor_count, bin) / share(background_count, bin));
    odds_[static_cast<size_t>(bin)] = static_cast<float>(std::min(0.0, odds));
  }
}

}  // namespace mpc
