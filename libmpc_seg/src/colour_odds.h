// Purpose: log-odds of actor against background for colours and for how much they changed.
// Units: natural logarithms.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/seg/colour_model.h"

namespace mpc {

// Evaluates two colour models. Keeps references to them.
class ColourOdds {
 public:
  // outlier_share: part of all pixels whose colour no model explains; a colour far from both models
  // then says nothing. exact: evaluate each colour; otherwise colours are rounded to 6 bits per
  // channel and every one is evaluated once.
  ColourOdds(const ColourModel& actor, const ColourModel& background, double outlier_share,
             bool exact);

  float operator()(const uint8_t* bgr);

 private:
  float Evaluate(const Eigen::Vector3f& bgr) const;

  const ColourModel& actor_;
  const ColourModel& background_;
  float outlier_density_;
  std::vector<float> table_;  // empty when exact
};

// Pixels of `bgr` (CV_8UC3) where `mask` (CV_8U) is not 0, evenly thinned out to `max_colours`.
std::vector<WeightedColour> CollectColours(const cv::Mat& bgr, const cv::Mat& mask,
                                           int max_colours);

// What the size of a pixel's change (SquaredChange) says, learnt from the changes of the actor and
// of the background. Only "still as the background is" counts, so values are at most 0: a changed
// pixel may also be background that the actor has just left.
class StillnessOdds {
 public:
  // change: CV_16U. actor, background: CV_8U, nonzero where a pixel certainly is one of them.
  StillnessOdds(const cv::Mat& change, const cv::Mat& actor, const cv::Mat& background);

  float operator()(uint16_t change) const { return odds_[Bin(change)]; }

 private:
  static constexpr int kBins = 32;
  static size_t Bin(uint16_t change);  // two per doubling of the change

  std::array<float, kBins> odds_;
};

}  // namespace mpc
