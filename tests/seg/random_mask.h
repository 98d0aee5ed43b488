// Purpose: masks of a few rectangles, of any size up to 60 px, and none at all.
#pragma once

#include <opencv2/core.hpp>

namespace mpc::testing {

// A few rectangles of pixels that count as inside.
inline cv::Mat RandomMask(cv::RNG* rng) {
  cv::Mat mask = cv::Mat::zeros(rng->uniform(1, 60), rng->uniform(1, 60), CV_8U);
  for (int i = rng->uniform(0, 4); i > 0; --i) {
    const cv::Point corner(rng->uniform(0, mask.cols), rng->uniform(0, mask.rows));
    const cv::Size size(rng->uniform(1, 20), rng->uniform(1, 20));
    mask(cv::Rect(corner, size) & cv::Rect({}, mask.size())).setTo(rng->uniform(1, 256));
  }
  return mask;
}

}  // namespace mpc::testing
