#include "colour_odds.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace mpc {
namespace {

constexpr double kGlobalShare = 0.1;  // of a place's colours come from everywhere; ours
constexpr double kRareShare = 0.003;  // of pixels, added to every bin of the changes; ours

constexpr float kPlateShare = 0.9F;   // of the background's pixels look as the plate does; ours
constexpr float kShadowShare = 0.1F;  // of those are in a shadow that the plate does not have
constexpr float kDarkest = 0.4F;      // share of the light that a shadow leaves, at least
constexpr float kPlateNoise = 5;      // of sensor and codec, colour steps

// What PlateDensity needs to know of a spread.
class PlateTable {
 public:
  struct Entry {
    float exponent;      // -1 / (2 variance)
    float lit_scale;     // of the density around a point,
    float shaded_scale;  // and around a line
    float shaded_width;

    float Gaussian(float squared_distance) const {
      const float x = exponent * squared_distance;
      return x < kNegligible ? 0 : std::exp(x);
    }
  };

  PlateTable() {
    for (size_t spread = 0; spread < entries_.size(); ++spread) {
      const float variance =
          kPlateNoise * kPlateNoise + static_cast<float>(spread) * static_cast<float>(spread);
      const float in_plane = 2 * std::numbers::pi_v<float> * variance;
      entries_[spread] = {-1 / (2 * variance), 1 / (in_plane * std::sqrt(in_plane)), 1 / in_plane,
                          2.5F * std::sqrt(variance)};
    }
  }
  const Entry& operator[](uint8_t spread) const { return entries_[spread]; }

 private:
  static constexpr float kNegligible = -40;
  std::array<Entry, 256> entries_;
};

}  // namespace

float PlateDensity(const cv::Vec3b& bgr, const cv::Vec3b& plate, uint8_t spread) {
  static const PlateTable table;
  const PlateTable::Entry& at = table[spread];
  const Eigen::Vector3f colour(bgr[0], bgr[1], bgr[2]), known(plate[0], plate[1], plate[2]);
  const float known_square = known.squaredNorm();
  const float lit = at.Gaussian((colour - known).squaredNorm()) * at.lit_scale;
  // Uniform along the way from kDarkest of the colour to the colour, Gaussian across.
  const float light = std::clamp(colour.dot(known) / std::max(known_square, 1.F), kDarkest, 1.F);
  const float shaded = at.Gaussian((colour - light * known).squaredNorm()) * at.shaded_scale /
                       ((1 - kDarkest) * std::sqrt(known_square) + at.shaded_width);
  return (1 - kShadowShare) * lit + kShadowShare * shaded;
}

PlacedColours CollectColours(const cv::Mat& bgr, const cv::Mat& mask, int max_colours) {
  const int step = 1 + cv::countNonZero(mask) / max_colours;
  PlacedColours found;
  int skip = 0;
  for (int y = 0; y < mask.rows; ++y) {
    const uint8_t* row = mask.ptr(y);
    const uint8_t* c = bgr.ptr(y);
    for (int x = 0; x < mask.cols; ++x, c += 3) {
      if (row[x] == 0 || --skip >= 0) continue;
      skip = step - 1;
      found.colours.push_back(
          {{static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])}});
      found.places.emplace_back(x, y);
    }
  }
  return found;
}

LocalColourModel::LocalColourModel(const PlacedColours& colours, int max_components,
                                   const cv::Size& size, double reach_px)
    : model_(colours.colours, max_components) {
  const bool global = reach_px == 0;
  cell_px_ =
      global ? std::max(size.width, size.height) : std::max(1, static_cast<int>(reach_px / 3));
  const cv::Size cells((size.width + cell_px_ - 1) / cell_px_,
                       (size.height + cell_px_ - 1) / cell_px_);
  const auto n = static_cast<size_t>(num_components());
  std::vector<cv::Mat1f> count(n);
  for (cv::Mat1f& c : count) c = cv::Mat1f(cells, 0.F);
  for (size_t i = 0; i < colours.colours.size(); ++i) {
    const auto k = static_cast<size_t>(model_.LikeliestComponent(colours.colours[i].bgr));
    count[k](colours.places[i] / cell_px_) += colours.colours[i].weight;
  }
  cv::Mat1f total(cells, 0.F);
  for (cv::Mat1f& c : count) {
    const double sigma = reach_px / cell_px_;
    if (!global) cv::GaussianBlur(c, c, {}, sigma, sigma, cv::BORDER_CONSTANT);
    total += c;
  }
  const auto everywhere = static_cast<float>(kGlobalShare * cv::mean(total)[0]);
  shares_.create(cells, CV_32FC(num_components()));
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      float* shares = shares_.ptr<float>(y) + static_cast<size_t>(x) * n;
      for (size_t k = 0; k < n; ++k) {
        const auto weight = static_cast<float>(model_.components()[k].weight);
        shares[k] = (count[k](y, x) + everywhere * weight) / (total(y, x) + everywhere);
      }
    }
  }
}

ColourOdds::ColourOdds(const LocalColourModel& actor, const LocalColourModel& background,
                       double outlier_share, bool exact)
    : actor_(actor),
      background_(background),
      outlier_density_(static_cast<float>(outlier_share / (1 - outlier_share) / (1 << 24))),
      exact_(exact) {
  if (!exact) begin_.assign(1 << 18, -1);
}

int32_t ColourOdds::Evaluate(const Eigen::Vector3f& bgr) {
  const size_t begin = densities_.size();
  const auto num_actor = static_cast<size_t>(actor_.num_components());
  densities_.resize(begin + num_actor + static_cast<size_t>(background_.num_components()));
  actor_.model().ComponentDensities(bgr, &densities_[begin]);
  background_.model().ComponentDensities(bgr, &densities_[begin + num_actor]);
  return static_cast<int32_t>(begin);
}

float ColourOdds::operator()(const cv::Vec3b& bgr, int x, int y, float plate_density,
                             float weight_plate) {
  int32_t begin = 0;
  if (exact_) {
    densities_.clear();
    Evaluate({static_cast<float>(bgr[0]), static_cast<float>(bgr[1]), static_cast<float>(bgr[2])});
  } else {
    int32_t& known =
        begin_[static_cast<size_t>((bgr[0] >> 2) << 12 | (bgr[1] >> 2) << 6 | bgr[2] >> 2)];
    const auto centre = [](uint8_t c) { return static_cast<float>(c & ~3) + 1.5F; };
    if (known < 0) known = Evaluate({centre(bgr[0]), centre(bgr[1]), centre(bgr[2])});
    begin = known;
  }
  const float* density = &densities_[static_cast<size_t>(begin)];
  const auto mix = [&](const LocalColourModel& model) {
    const Eigen::Map<const Eigen::VectorXf> shares(model.Shares(x, y), model.num_components());
    const Eigen::Map<const Eigen::VectorXf> densities(density, shares.size());
    density += shares.size();
    return shares.dot(densities) + outlier_density_ + std::numeric_limits<float>::min();
  };
  const float actor = mix(actor_);
  const float background = mix(background_);
  const float odds = std::log(actor / background);
  if (plate_density < 0) return odds;
  return odds - weight_plate * std::log(1 - kPlateShare + kPlateShare * plate_density / background);
}

size_t StillnessOdds::Bin(uint16_t change) {
  // The exponent and the highest bit of the mantissa, which tells the upper half of an octave.
  const auto bits = std::bit_cast<uint32_t>(static_cast<float>(change + 1));
  return std::min<size_t>((bits >> 22) - 2 * 127, kBins - 1);
}

StillnessOdds::StillnessOdds(const cv::Mat& change, const cv::Mat& actor,
                             const cv::Mat& background) {
  std::array<double, kBins> actor_count{}, background_count{};
  for (int y = 0; y < change.rows; ++y) {
    const uint16_t* row = change.ptr<uint16_t>(y);
    const uint8_t* is_actor = actor.ptr(y);
    const uint8_t* is_background = background.ptr(y);
    for (int x = 0; x < change.cols; ++x) {
      if (is_actor[x]) ++actor_count[Bin(row[x])];
      if (is_background[x]) ++background_count[Bin(row[x])];
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
