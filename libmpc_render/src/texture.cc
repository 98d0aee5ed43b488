#include "mpc/render/texture.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr float kLightOfUnit = 1.0f / (255 * 255);

// i modulo n for i in [-1, n].
int Wrapped(int i, int n) { return i < 0 ? i + n : (i >= n ? i - n : i); }

// x - floor(x) for |x| < 2e9, without a call of the library's floor.
float Fraction(float x) {
  const float rest = x - static_cast<float>(static_cast<int>(x));
  return rest < 0 ? rest + 1 : rest;
}

}  // namespace

Texture::Texture(const cv::Mat& bgr) {
  if (bgr.empty() || bgr.type() != CV_8UC3) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("a texture of {} x {} and type {}, expected 8-bit BGR", bgr.cols,
                            bgr.rows, bgr.type()));
  }
  cv::Mat level(bgr.size(), CV_32FC4);  // the sum of a level's four texels is exact in floats
  for (int y = 0; y < bgr.rows; ++y) {
    for (int x = 0; x < bgr.cols; ++x) {
      const cv::Vec3f from = bgr.at<cv::Vec3b>(y, x);
      level.at<cv::Vec4f>(y, x) = {from[0] * from[0], from[1] * from[1], from[2] * from[2], 0};
    }
  }
  const auto keep = [this](const cv::Mat& light) {
    levels_.emplace_back();
    light.convertTo(levels_.back(), CV_16U);
  };
  keep(level);
  while (level.cols > 1 || level.rows > 1) {
    cv::Mat half;
    cv::resize(level, half, {std::max(1, level.cols / 2), std::max(1, level.rows / 2)}, 0, 0,
               cv::INTER_AREA);
    keep(half);
    level = half;
  }
}

Eigen::Array4f Texture::Sample(float u, float v, float uv_area) const {
  // The exponent of the pixel's area in texels: a quarter of the texels per level.
  const float texels = uv_area * static_cast<float>(width()) * static_cast<float>(height());
  const int exponent =
      texels > 1 ? static_cast<int>(std::bit_cast<uint32_t>(texels) >> 23) - 127 : 0;
  const cv::Mat& level =
      levels_[std::min(static_cast<size_t>((exponent + 1) / 2), levels_.size() - 1)];
  const float x = Fraction(u) * static_cast<float>(level.cols) - 0.5f;
  const float y = Fraction(v) * static_cast<float>(level.rows) - 0.5f;
  const int left = static_cast<int>(x + 1) - 1;
  const int top = static_cast<int>(y + 1) - 1;
  const float fx = x - static_cast<float>(left);
  const float fy = y - static_cast<float>(top);
  const int x0 = Wrapped(left, level.cols), x1 = Wrapped(left + 1, level.cols);
  const auto* row0 = level.ptr<uint16_t>(Wrapped(top, level.rows));
  const auto* row1 = level.ptr<uint16_t>(Wrapped(top + 1, level.rows));
  const float right = fx * kLightOfUnit, left_part = kLightOfUnit - right;
  Eigen::Array4f light;
  for (int i = 0; i < 4; ++i) {
    const float above = left_part * static_cast<float>(row0[4 * x0 + i]) +
                        right * static_cast<float>(row0[4 * x1 + i]);
    const float below = left_part * static_cast<float>(row1[4 * x0 + i]) +
                        right * static_cast<float>(row1[4 * x1 + i]);
    light[i] = above + fy * (below - above);
  }
  return light;
}

}  // namespace mpc
