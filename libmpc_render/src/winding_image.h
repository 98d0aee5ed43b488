// Purpose: fills polygons by their edges alone. A pixel's winding number is the sum of the weights
// of the edges it lies to the right of; edges shared by two polygons cancel and need not be drawn.
// Source: scan conversion by signed crossings; the same top-left rule as the rasteriser, exact.
// Symbols: screen coordinates as in screen.h.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "screen.h"

namespace mpc {

class WindingImage {
 public:
  // Covers the pixels of `bounds`; all winding numbers are 0.
  explicit WindingImage(const cv::Rect& bounds);

  // `weight` times the edge a -> b of a polygon. Polygons that run clockwise as seen count positive.
  void AddEdge(const ScreenVertex& a, const ScreenVertex& b, int weight);

  // All edges of a triangle, counted positive whichever way it runs.
  void AddTriangle(const ScreenVertex& a, const ScreenVertex& b, const ScreenVertex& c);

  // All triangles of a convex polygon.
  void AddFan(const std::vector<ScreenVertex>& polygon);

  // Sets the pixels of `mask` (CV_8UC1, the size of the bounds) to 255 where the winding number is
  // not 0, else to 0.
  void Resolve(cv::Mat mask) const;

 private:
  cv::Rect bounds_;
  // From the pixel to the left, row by row; modulo 2^16, which no number of layers reaches.
  std::vector<uint16_t> change_;
};

}  // namespace mpc
