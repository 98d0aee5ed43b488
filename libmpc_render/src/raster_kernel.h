// Purpose: triangles into the depth and id images: the inner loop of the rasteriser.
// Symbols: see screen.h. The images hold 1 / z (0: nothing yet) and ids; the greater 1 / z wins, of
// equal ones the earlier drawn. Both kernels give the same bits.
//
// 1 / z is interpolated around the triangle's first vertex, in float for triangles of up to 64 px,
// in double for larger ones, and kept within the range of the three vertices. A pixel's value does
// not depend on what part of the picture is drawn.
#pragma once

#include <cstddef>

#include "screen.h"

namespace mpc {

struct RasterTarget {
  float* inverse_z;
  int* ids;
  std::ptrdiff_t inverse_z_stride;  // in elements
  std::ptrdiff_t ids_stride;
  int width;
  int height;
};

// Draws `count` triangles of three vertex indices each, with ids from first_id on. Those with a
// vertex that is not kVisible are left out.
using TriangleKernel = void (*)(const ScreenVertex* vertices, const int* corners, int count,
                                int first_id, const RasterTarget& target);

// Tests every pixel of the bounding box.
void FillTrianglesScalar(const ScreenVertex* vertices, const int* corners, int count, int first_id,
                         const RasterTarget& target);

// The fastest kernel this machine runs: eight pixels at a time with AVX2, else the scalar one.
TriangleKernel BestTriangleKernel();

// 1 / z to z; 0 stays.
void InvertSeen(float* values, int count);

}  // namespace mpc
