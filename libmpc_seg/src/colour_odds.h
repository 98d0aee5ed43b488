// Purpose: log-odds of actor against background for colours and for how much they changed, learnt
// from regions that certainly are one of them.
// Units: natural logarithms.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/seg/colour_model.h"

namespace mpc {

struct PlacedColours {
  std::vector<WeightedColour> colours;
  std::vector<cv::Point> places;  // of each colour
};

// A colour model whose components count more where their colours are: at x, component k has the
// share that it has among the colours around x.
class LocalColourModel {
 public:
  // size: of the picture. reach_px: sigma of "around"; 0: the same shares everywhere.
  LocalColourModel(const PlacedColours& colours, int max_components, const cv::Size& size,
                   double reach_px);

  const ColourModel& model() const { return model_; }
  int num_components() const { return static_cast<int>(model_.components().size()); }

  // Shares of the components at a pixel; they sum to 1.
  const float* Shares(int x, int y) const {
    return shares_.ptr<float>(y / cell_px_) + shares_.channels() * ptrdiff_t{x / cell_px_};
  }

 private:
  ColourModel model_;
  int cell_px_;
  cv::Mat shares_;  // per cell, one channel per component
};

// Evaluates two models. Keeps references to them.
class ColourOdds {
 public:
  // outlier_share: part of all pixels whose colour no model explains; a colour far from both models
  // then says nothing. exact: evaluate each colour; otherwise colours are rounded to 6 bits per
  // channel and every one is evaluated once.
  ColourOdds(const LocalColourModel& actor, const LocalColourModel& background,
             double outlier_share, bool exact);

  // Of a colour at pixel (x, y). plate_density: of the colour where the background is known, < 0
  // where it is not; then kPlateShare of the background's pixels look like that. What this adds to
  // the log-odds counts `weight_plate` times.
  float operator()(const cv::Vec3b& bgr, int x, int y, float plate_density = -1,
                   float weight_plate = 0);

 private:
  // Appends the components' densities at a colour to densities_ and returns where they begin.
  int32_t Evaluate(const Eigen::Vector3f& bgr);

  const LocalColourModel& actor_;
  const LocalColourModel& background_;
  float outlier_density_;
  bool exact_;
  std::vector<int32_t> begin_;    // per rounded colour: of its densities, -1: not evaluated yet
  std::vector<float> densities_;  // of the actor's components, then of the background's
};

// Density of a colour of background whose colour is known up to `spread`: as it is, or in a shadow,
// which takes a part of its light away and keeps its hue. Per cubic colour step.
float PlateDensity(const cv::Vec3b& bgr, const cv::Vec3b& plate, uint8_t spread);

// Pixels of `bgr` (CV_8UC3) where `mask` (CV_8U) is not 0, evenly thinned out to `max_colours`.
PlacedColours CollectColours(const cv::Mat& bgr, const cv::Mat& mask, int max_colours);

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
