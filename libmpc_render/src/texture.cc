#include "mpc/render/texture.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "mpc/core/error.h"

namespace mpc {
namespace {

// i modulo n for i in [-1, n].
int Wrapped(int i, int n) { return i < 0 ? i + n : (i >= n ? i - n : i); }

// x - floor(x) for |x| < 2e9, without a call of the library's floor.
double Fraction(double x) {
  const double rest = x - static_cast<int>(x);
  return rest < 0 ? rest + 1 : rest;
}

}  // namespace

Texture::Texture(const cv::Mat& bgr) {
  if (bgr.empty() || bgr.type() != CV_8UC3) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("a texture of {} x {} and type {}, expected 8-bit BGR", bgr.cols,
                            bgr.rows, bgr.type()));
  }
  cv::Mat level(bgr.size(), CV_32FC4);
  for (int y = 0; y < bgr.rows; ++y) {
    for (int x = 0; x < bgr.cols; ++x) {
      const auto& from = bgr.at<cv::Vec3b>(y, x);
      level.at<cv::Vec4f>(y, x) = {LinearFromByte(from[0]), LinearFromByte(from[1]),
                                   LinearFromByte(from[2]), 0};
    }
  }
  levels_.push_back(level);
  while (level.cols > 1 || level.rows > 1) {
    cv::Mat half;
    cv::resize(level, half, {std::max(1, level.cols / 2), std::max(1, level.rows / 2)}, 0, 0,
               cv::INTER_AREA);
    levels_.push_back(half);
    level = half;
  }
}

Eigen::Array4f Texture::Sample(double u, double v, double uv_area) const {
  // The exponent of the pixel's area in texels: a quarter of the texels per level.
  const auto texels = static_cast<float>(uv_area * width() * height());
  const int exponent =
      texels > 1 ? static_cast<int>(std::bit_cast<uint32_t>(texels) >> 23) - 127 : 0;
  const cv::Mat& level =
      levels_[std::min(static_cast<size_t>((exponent + 1) / 2), levels_.size() - 1)];
  const float x = static_cast<float>(Fraction(u)) * static_cast<float>(level.cols) - 0.5f;
  const float y = static_cast<float>(Fraction(v)) * static_cast<float>(level.rows) - 0.5f;
  const int left = static_cast<int>(x + 1) - 1;
  const int top = static_cast<int>(y + 1) - 1;
  const float fx = x - static_cast<float>(left);
  const float fy = y - static_cast<float>(top);
  const int x0 = Wrapped(left, level.cols), x1 = Wrapped(left + 1, level.cols);
  const float* row0 = level.ptr<float>(Wrapped(top, level.rows));
  const float* row1 = level.ptr<float>(Wrapped(top + 1, level.rows));
  using Texel = Eigen::Map<const Eigen::Array4f>;
  const Eigen::Array4f above = Texel(row0 + 4 * x0) * (1 - fx) + Texel(row0 + 4 * x1) * fx;
  const Eigen::Array4f below = Texel(row1 + 4 * x0) * (1 - fx) + Texel(row1 + 4 * x1) * fx;
  return above * (1 - fy) + below * fy;
}

}  // namespace mpc
