// Purpose: a part of a picture resampled to a network's input, without aliasing.
#pragma once

#include <opencv2/core.hpp>

namespace mpc::internal {

// side x side pixels of `picture`; picture_from_square maps their centres to pixels. Each is the
// mean over its area where the picture has finer pixels: MediaPipe's own sampling.
cv::Mat WarpToSquare(const cv::Mat& picture, const cv::Matx23d& picture_from_square, int side,
                     int border);

}  // namespace mpc::internal
