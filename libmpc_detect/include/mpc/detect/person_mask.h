// Purpose: which pixels are the person's, as the landmark network says.
// Source: docs/detect.md. Units: pixels. Symbols: F frames.
#pragma once

#include <opencv2/core.hpp>
#include <span>

#include "mpc/detect/person_region.h"

namespace mpc {

// Of one frame that was looked at.
struct PersonMask {
  int frame = 0;
  PersonRegion region;
  cv::Mat probability = {};  // CV_8U, 0 to 255, of the region's square
};

// Probability in a picture of `size`, CV_8U, 0 outside of the region.
cv::Mat PictureMask(const PersonMask& mask, const cv::Size& size);

// The same in any frame, from the masks of a clip in the order of their frames: between two that are
// at most `max_gap` frames apart the region moves on evenly and one mask fades into the next. Empty
// for other frames.
cv::Mat PictureMask(std::span<const PersonMask> masks, int frame, int max_gap,
                    const cv::Size& size);

}  // namespace mpc
