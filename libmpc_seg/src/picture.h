// Purpose: what all parts of the stage check and convert: pictures and masks of any usual type.
#pragma once

#include <opencv2/core.hpp>

namespace mpc {

// Throws Error (kInvalidArgument, kUnsupported) when `picture` is no picture of a type that
// ToBgr8 converts; `name` says which one in the message.
void CheckPicture(const cv::Mat& picture, const char* name);

// Throws Error unless `mask` is CV_8U of `size`.
void CheckMask(const cv::Mat& mask, const cv::Size& size, const char* name);

// As CV_8UC3. Shares the picture's memory when it already is.
cv::Mat ToBgr8(const cv::Mat& picture);

// `area` of a picture, which may reach over its right and lower border: the border is repeated.
cv::Mat Crop(const cv::Mat& picture, const cv::Rect& area);

// Half the width and height, each pixel the mean of four; an odd last column or row is left out.
// Sides must be at least 2.
cv::Mat Halved(const cv::Mat& picture);

}  // namespace mpc
