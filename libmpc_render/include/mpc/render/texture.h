// Purpose: a picture to be sampled at any size without flicker: linear light, halved again and again.
// Units: texture coordinates as in glTF, (0, 0) is the top left corner, repeating beyond [0, 1].
// Light is linear: the square of a colour's value, 0 to 1 (a gamma of 2).
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace mpc {

// Linear light of a colour value 0 to 255, and back.
inline float LinearFromByte(float value) { return value * value * (1.0f / (255 * 255)); }

class Texture {
 public:
  // CV_8UC3. Throws Error (kInvalidArgument) for another type or an empty picture.
  explicit Texture(const cv::Mat& bgr);

  // Texels of the full picture.
  int width() const { return levels_.front().cols; }
  int height() const { return levels_.front().rows; }

  // Linear light (b, g, r, 0) at (u, v), bilinear, in the level whose texels have about the size of
  // the pixel: `uv_area` is the pixel's area in texture coordinates. |u| and |v| below 2e9. Thread-safe.
  Eigen::Array4f Sample(float u, float v, float uv_area) const;

 private:
  // CV_16UC4 of 255^2 times the light, each half as large as the one before, the last 1 x 1.
  std::vector<cv::Mat> levels_;
};

}  // namespace mpc
