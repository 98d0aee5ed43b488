#include "sensor_noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace mpc {
namespace {

constexpr int kBits = 12;

// Quantiles of the normal distribution at the middle of 2^kBits equal parts, shifted by half so that
// flooring rounds.
std::vector<float> Quantiles(double sigma) {
  // By inverting the cumulative distribution step by step: x grows with its probability.
  constexpr int kCount = 1 << kBits;
  std::vector<float> values(kCount);
  double x = -6;
  for (int i = 0; i < kCount; ++i) {
    const double wanted = (i + 0.5) / kCount;
    for (int step = 0; step < 60; ++step) {  // Newton, from below
      const double have = 0.5 * std::erfc(-x / std::numbers::sqrt2);
      const double slope = std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
      const double change = std::clamp((wanted - have) / slope, -0.5, 0.5);
      x += change;
      if (std::abs(change) < 1e-12) break;
    }
    values[static_cast<size_t>(i)] = static_cast<float>(sigma * x + 0.5);
  }
  return values;
}

// SplitMix64 (Steele et al. 2014).
uint64_t Mixed(uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return z ^ (z >> 31);
}

}  // namespace

void AddSensorNoise(double sigma, uint64_t seed, int frame, cv::Mat* bgr) {
  if (sigma <= 0) return;
  const std::vector<float> noise = Quantiles(sigma);
  uint64_t counter = Mixed(seed + 1) + Mixed(static_cast<uint64_t>(frame) + 0x5eed);
  constexpr uint64_t kMask = (1 << kBits) - 1;
  for (int y = 0; y < bgr->rows; ++y) {
    uchar* values = bgr->ptr(y);
    for (int i = 0; i < 3 * bgr->cols;) {
      uint64_t bits = Mixed(counter += 0x9e3779b97f4a7c15);
      for (int k = 0; k < 64 / kBits && i < 3 * bgr->cols; ++k, ++i, bits >>= kBits) {
        const float value = static_cast<float>(values[i]) + noise[bits & kMask];
        values[i] = static_cast<uchar>(std::clamp(static_cast<int>(std::floor(value)), 0, 255));
      }
    }
  }
}

}  // namespace mpc
