#include "warp.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mpc::internal {

cv::Mat WarpToSquare(const cv::Mat& picture, const cv::Matx23d& picture_from_square, int side,
                     int border) {
  constexpr int kMaxSamples = 8;  // of a pixel, along each axis
  const cv::Matx23d& m = picture_from_square;
  const double scale = std::hypot(m(0, 0), m(1, 0));
  const int samples = std::clamp(static_cast<int>(std::ceil(scale)), 1, kMaxSamples);
  cv::Matx23d picture_from_samples = m;
  const double center = (1.0 - samples) / (2.0 * samples);  // of the first sample, in pixels
  for (int r = 0; r < 2; ++r) {
    picture_from_samples(r, 2) += center * (m(r, 0) + m(r, 1));
    picture_from_samples(r, 0) /= samples;
    picture_from_samples(r, 1) /= samples;
  }
  cv::Mat square;
  cv::warpAffine(picture, square, picture_from_samples, {samples * side, samples * side},
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, border);
  if (samples > 1) cv::resize(square, square, {side, side}, 0, 0, cv::INTER_AREA);
  return square;
}

}  // namespace mpc::internal
