// Purpose: rectangles around what is inside of a mask. Units: pixels.
#pragma once

#include <opencv2/core.hpp>

namespace mpc {

// The least rectangle around what is inside; empty if nothing is. cv::boundingRect in a quarter of
// its time, for masks that are mostly empty. mask: CV_8U, nonzero inside. Thread-safe; allocates nothing.
cv::Rect MaskBounds(const cv::Mat& mask);

// A rectangle with a margin all around, as far as it lies within a picture.
cv::Rect Grown(const cv::Rect& box, int margin, const cv::Size& picture_size);

}  // namespace mpc
