#include "winding_image.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>

namespace mpc {
namespace {

// n / d rounded down, d > 0.
int64_t FloorDivide(int64_t n, int64_t d) { return n >= 0 ? n / d : -((d - 1 - n) / d); }

}  // namespace

WindingImage::WindingImage(const cv::Rect& bounds)
    : bounds_(bounds), change_(static_cast<size_t>(bounds.area())) {}

void WindingImage::AddEdge(const ScreenVertex& a, const ScreenVertex& b, int weight) {
  // Left edges run up (y points down) and are entered from the left.
  const bool up = b.y < a.y;
  const ScreenVertex& top = up ? b : a;
  const ScreenVertex& bottom = up ? a : b;
  const int entered = up ? weight : -weight;
  const int y_begin = std::max(CeilPixel(top.y), bounds_.y);
  const int y_end = std::min(CeilPixel(bottom.y), bounds_.y + bounds_.height);
  if (y_begin >= y_end) return;

  // The first pixel at or right of the edge, ceil(crossing), and its step from row to row, both as
  // quotient and remainder.
  const int64_t dx = bottom.x - top.x, dy = bottom.y - top.y;
  const int64_t divisor = dy * kSubpixels;
  const int64_t left = top.x - bounds_.x * kSubpixels;
  const int64_t crossing = left * dy + (static_cast<int64_t>(y_begin) * kSubpixels - top.y) * dx;
  int64_t x = FloorDivide(crossing + divisor - 1, divisor);
  int64_t remainder = crossing + divisor - 1 - x * divisor;
  const int64_t step = FloorDivide(dx, dy);
  const int64_t step_remainder = (dx - step * dy) * kSubpixels;
  uint16_t* row = change_.data() + static_cast<ptrdiff_t>(y_begin - bounds_.y) * bounds_.width;
  for (int y = y_begin; y < y_end; ++y, row += bounds_.width) {
    if (x < bounds_.width) row[std::max<int64_t>(0, x)] += static_cast<uint16_t>(entered);
    x += step;
    remainder += step_remainder;
    if (remainder >= divisor) {
      remainder -= divisor;
      ++x;
    }
  }
}

void WindingImage::AddTriangle(const ScreenVertex& a, const ScreenVertex& b,
                               const ScreenVertex& c) {
  const int64_t area = DoubleArea(a, b, c);
  if (area == 0) return;
  const int weight = area > 0 ? 1 : -1;
  AddEdge(a, b, weight);
  AddEdge(b, c, weight);
  AddEdge(c, a, weight);
}

void WindingImage::AddFan(const std::vector<ScreenVertex>& polygon) {
  for (size_t i = 2; i < polygon.size(); ++i) AddTriangle(polygon[0], polygon[i - 1], polygon[i]);
}

void WindingImage::Resolve(cv::Mat mask) const {
  constexpr int kBlock = 8;  // pixels that are looked at together: few of them change anything
  const uint16_t* change = change_.data();
  for (int y = 0; y < bounds_.height; ++y, change += bounds_.width) {
    uchar* out = mask.ptr<uchar>(y);
    uint16_t winding = 0;
    int x = 0;
    for (; x + kBlock <= bounds_.width; x += kBlock) {
      uint64_t changes[2];
      std::memcpy(changes, change + x, sizeof changes);
      if ((changes[0] | changes[1]) == 0) {
        std::memset(out + x, winding != 0 ? 255 : 0, kBlock);
        continue;
      }
      for (int i = x; i < x + kBlock; ++i) out[i] = (winding += change[i]) != 0 ? 255 : 0;
    }
    for (; x < bounds_.width; ++x) out[x] = (winding += change[x]) != 0 ? 255 : 0;
  }
}

}  // namespace mpc
