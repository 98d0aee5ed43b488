// Purpose: where a trimap made of the model is wrong by more than its band: cloth that swung out
// of it, background seen through what the model covers.
// Source: ours; docs/segmentation.md. Units: pixels.
#pragma once

#include <opencv2/core.hpp>

#include "mpc/seg/background_plate.h"

namespace mpc {

// What of a mask (CV_8U) is at least twice as thick as a radius.
cv::Mat Thick(const cv::Mat& mask, double radius);

// CV_8U, 255 inside; empty where there is nothing.
struct Strays {
  cv::Mat beyond;  // of the actor: other than the plate, of the actor's colours, joined to the mask
  cv::Mat within;  // of the background: as the plate, and not of the actor's colours
};

// bgr: CV_8UC3, the actor's surroundings, of the plate's size. actor: CV_8U, where the actor is
// thought to be. core_px: how far within it the actor's colours are learnt. size_px: the actor's. Only
// pieces thicker than parts of it count, and only where the plate is known.
Strays FindStrays(const cv::Mat& bgr, const BackgroundPlate& plate, const cv::Mat& actor,
                  double core_px, double size_px);

}  // namespace mpc
