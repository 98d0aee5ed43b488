// Purpose: pictures of materials, made from noise: they repeat without a seam.
// Units: pixels, colours 0 to 1.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <random>

namespace mpc {

// Colours and numbers by seed.
class Dice {
 public:
  explicit Dice(uint64_t seed) : engine_(seed) {}
  double Between(double from, double to) {
    return from + (to - from) * std::uniform_real_distribution<double>(0, 1)(engine_);
  }
  int Below(int n) { return static_cast<int>(Between(0, n)); }
  bool Chance(double probability) { return Between(0, 1) < probability; }

 private:
  std::mt19937_64 engine_;
};

// BGR, 0 to 255, of hue (0 red, 1/3 green, 2/3 blue), saturation and value.
cv::Vec3f Hsv(double hue, double saturation, double value);

cv::Mat PlanksTexture(Dice* dice);     // 2 m
cv::Mat TilesTexture(Dice* dice);      // 2 m
cv::Mat BricksTexture(Dice* dice);     // 2 m
cv::Mat PlasterTexture(Dice* dice);    // 3 m
cv::Mat WallpaperTexture(Dice* dice);  // 2 m
cv::Mat GrassTexture(Dice* dice);      // 3 m
cv::Mat PavingTexture(Dice* dice);     // 3 m
cv::Mat FacadeTexture(Dice* dice);     // 12 m: 4 x 4 windows
cv::Mat LeavesTexture(Dice* dice);
cv::Mat BarkTexture(Dice* dice);
cv::Mat FabricTexture(Dice* dice);
cv::Mat BooksTexture(Dice* dice);  // a shelf of 4 boards
cv::Mat PaintingTexture(Dice* dice);
cv::Mat BallTexture(Dice* dice);  // sectors in two colours
cv::Mat SkyTexture(Dice* dice);   // around: width; from the horizon to the zenith: bottom to top

}  // namespace mpc
