// Purpose: what the shape of M says of a pixel: how far M's outline is, and how far it tends to be off.
// Units: pixels, natural logarithms. Symbols: M mask of the actor's mesh, d distance to its outline.
#pragma once

#include <opencv2/core.hpp>

namespace mpc {

// Distance of every pixel to the next one outside of a mask (CV_8U, 0 or 255); 0 outside.
cv::Mat1f Depth(const cv::Mat& mask);

// d of every pixel: positive inside, negative outside. mask: CV_8U, 0 or 255.
cv::Mat1f SignedDistance(const cv::Mat& mask);

// One over sigma, by which M's outline is off around each pixel, 1 / px. It is measured: the mean
// distance between the outlines of M and of the cut within about `reach_px`. labels: CV_8U, the cut,
// nonzero inside. is_sure: CV_8U, nonzero where the picture alone tells the pixel's label; only where
// both sides of the cut are sure it counts. 0 everywhere when there are too few such places.
cv::Mat1f MeasurePrecision(const cv::Mat1f& distance, const cv::Mat& labels, const cv::Mat& is_sure,
                           double reach_px);

// Log-odds of actor against background when M's outline is off by sigma, a Gaussian, but for one
// place in twenty where it is anywhere.
cv::Mat1f OutlineOdds(const cv::Mat1f& distance, const cv::Mat1f& precision);

// Share of a cut's links that is left where a good M has its outline:
// 1 - discount min(1, (sharp / sigma)^2) exp(-d^2 / (2 sigma^2)).
cv::Mat1f OutlineStrength(const cv::Mat1f& distance, const cv::Mat1f& precision, double discount,
                          double sharp_px);

}  // namespace mpc
