#include "raster_kernel.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#if defined(__x86_64__) && defined(__GNUC__)
#define MPC_AVX2_KERNEL 1
#include <immintrin.h>
#endif

namespace mpc {
namespace {

// With it, edge functions in and around the bounding box fit into 32 bits.
constexpr int kSmallTriangle = 64 * kSubpixels;

// A triangle that runs clockwise, and the pixels of its bounding box inside the picture.
struct Prepared {
  ScreenVertex a, b, c;
  int64_t area;
  int x_begin, y_begin, x_last, y_last;
  float least, most;  // range of 1 / z
  bool small;
};

// False when there is nothing to draw.
inline bool Prepare(const ScreenVertex* vertices, const int* corners, const RasterTarget& target,
                    Prepared* p) {
  p->a = vertices[corners[0]];
  p->b = vertices[corners[1]];
  p->c = vertices[corners[2]];
  if (std::max({p->a.state, p->b.state, p->c.state}) != VertexState::kVisible) return false;
  const int min_x = std::min({p->a.x, p->b.x, p->c.x});
  const int max_x = std::max({p->a.x, p->b.x, p->c.x});
  const int min_y = std::min({p->a.y, p->b.y, p->c.y});
  const int max_y = std::max({p->a.y, p->b.y, p->c.y});
  p->x_begin = std::max(0, CeilPixel(min_x));
  p->y_begin = std::max(0, CeilPixel(min_y));
  p->x_last = std::min(target.width - 1, FloorPixel(max_x));
  p->y_last = std::min(target.height - 1, FloorPixel(max_y));
  if (p->x_begin > p->x_last || p->y_begin > p->y_last) return false;
  p->area = DoubleArea(p->a, p->b, p->c);
  if (p->area == 0) return false;
  if (p->area < 0) {
    std::swap(p->b, p->c);
    p->area = -p->area;
  }
  p->least = std::min({p->a.inverse_z, p->b.inverse_z, p->c.inverse_z});
  p->most = std::max({p->a.inverse_z, p->b.inverse_z, p->c.inverse_z});
  p->small = std::max(max_x - min_x, max_y - min_y) <= kSmallTriangle;
  return true;
}

// (to - from) x (p - from) minus the least value that counts as inside: not negative when p lies on
// the inner side of the edge. Int is wide enough for the edge functions.
template <typename Int>
struct Edge {
  Edge(const ScreenVertex& from, const ScreenVertex& to, int x_px, int y_px) {
    const Int dx = to.x - from.x;
    const Int dy = to.y - from.y;
    // Top edges run right, left edges run up (y points down): they own the pixels on them.
    const bool top_left = dy == 0 ? dx > 0 : dy < 0;
    step_x = -dy * kSubpixels;
    step_y = dx * kSubpixels;
    value = dx * (y_px * kSubpixels - from.y) - dy * (x_px * kSubpixels - from.x) - !top_left;
  }
  Int step_x;
  Int step_y;
  Int value;
};

// 1 / z as a plane over the picture, around the first vertex.
template <typename Real>
struct DepthPlane {
  explicit DepthPlane(const Prepared& p) : x(p.a.x), y(p.a.y), value(p.a.inverse_z) {
    const Real scale = 1 / static_cast<Real>(p.area);
    const Real toward_b = (p.b.inverse_z - value) * scale;
    const Real toward_c = (p.c.inverse_z - value) * scale;
    step_x =
        static_cast<Real>(p.c.y - p.a.y) * toward_b - static_cast<Real>(p.b.y - p.a.y) * toward_c;
    step_y =
        static_cast<Real>(p.b.x - p.a.x) * toward_c - static_cast<Real>(p.c.x - p.a.x) * toward_b;
  }
  Real AtRow(int y_px) const { return value + static_cast<Real>(y_px * kSubpixels - y) * step_y; }
  Real At(Real at_row, int x_px) const {
    return at_row + static_cast<Real>(x_px * kSubpixels - x) * step_x;
  }
  int x;
  int y;
  Real value;
  Real step_x;  // per 1/256 px
  Real step_y;
};

inline void Draw(float inverse_z, const Prepared& p, int id, float* stored, int* stored_id) {
  const float value = std::min(std::max(inverse_z, p.least), p.most);
  if (value > *stored) {
    *stored = value;
    *stored_id = id;
  }
}

template <typename Int, typename Real>
void FillBox(const Prepared& p, int id, const RasterTarget& target) {
  Edge<Int> bc(p.b, p.c, p.x_begin, p.y_begin);
  Edge<Int> ca(p.c, p.a, p.x_begin, p.y_begin);
  Edge<Int> ab(p.a, p.b, p.x_begin, p.y_begin);
  const DepthPlane<Real> plane(p);
  for (int y = p.y_begin; y <= p.y_last; ++y) {
    float* row = target.inverse_z + y * target.inverse_z_stride;
    int* ids = target.ids + y * target.ids_stride;
    const Real at_row = plane.AtRow(y);
    Int value_bc = bc.value, value_ca = ca.value, value_ab = ab.value;
    for (int x = p.x_begin; x <= p.x_last; ++x) {
      if ((value_bc | value_ca | value_ab) >= 0) {
        Draw(static_cast<float>(plane.At(at_row, x)), p, id, &row[x], &ids[x]);
      }
      value_bc += bc.step_x;
      value_ca += ca.step_x;
      value_ab += ab.step_x;
    }
    bc.value += bc.step_y;
    ca.value += ca.step_y;
    ab.value += ab.step_y;
  }
}

void FillPrepared(const Prepared& p, int id, const RasterTarget& target) {
  if (p.small) {
    FillBox<int, float>(p, id, target);
  } else {
    FillBox<int64_t, double>(p, id, target);
  }
}

}  // namespace

void FillTrianglesScalar(const ScreenVertex* vertices, const int* corners, int count, int first_id,
                         const RasterTarget& target) {
  Prepared p;
  for (int t = 0; t < count; ++t) {
    if (Prepare(vertices, corners + 3 * t, target, &p)) FillPrepared(p, first_id + t, target);
  }
}

#if MPC_AVX2_KERNEL

// Without FMA, so that no product is rounded differently than in the scalar kernel.
#define MPC_TARGET_AVX2 __attribute__((target("avx2")))

namespace {

// Columns of eight pixels, each from top to bottom.
MPC_TARGET_AVX2 inline void FillSmallAvx2(const Prepared& p, int id, const RasterTarget& target,
                                          int x_first, int num_columns) {
  const DepthPlane<float> plane(p);
  const std::ptrdiff_t row_stride = target.inverse_z_stride, ids_stride = target.ids_stride;
  const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256 least = _mm256_set1_ps(p.least), most = _mm256_set1_ps(p.most);
  const __m256 new_id = _mm256_castsi256_ps(_mm256_set1_epi32(id));
  for (int column = 0; column < num_columns; ++column) {
    const int x = x_first + 8 * column;
    const Edge<int> bc(p.b, p.c, x, p.y_begin);
    const Edge<int> ca(p.c, p.a, x, p.y_begin);
    const Edge<int> ab(p.a, p.b, x, p.y_begin);
    const auto along_row = [&](const Edge<int>& edge) MPC_TARGET_AVX2 {
      return _mm256_add_epi32(_mm256_set1_epi32(edge.value),
                              _mm256_mullo_epi32(lane, _mm256_set1_epi32(edge.step_x)));
    };
    __m256i value_bc = along_row(bc), value_ca = along_row(ca), value_ab = along_row(ab);
    const __m256i down_bc = _mm256_set1_epi32(bc.step_y);
    const __m256i down_ca = _mm256_set1_epi32(ca.step_y);
    const __m256i down_ab = _mm256_set1_epi32(ab.step_y);
    const __m256i dx = _mm256_add_epi32(_mm256_set1_epi32(x * kSubpixels - plane.x),
                                        _mm256_slli_epi32(lane, kSubpixelBits));
    const __m256 across = _mm256_mul_ps(_mm256_cvtepi32_ps(dx), _mm256_set1_ps(plane.step_x));
    float* row = target.inverse_z + p.y_begin * row_stride + x;
    int* ids = target.ids + p.y_begin * ids_stride + x;
    const int y_last = p.y_last;
    for (int y = p.y_begin; y <= y_last; ++y) {
      const __m256 outside =
          _mm256_castsi256_ps(_mm256_or_si256(_mm256_or_si256(value_bc, value_ca), value_ab));
      __m256 depth = _mm256_add_ps(_mm256_set1_ps(plane.AtRow(y)), across);
      depth = _mm256_min_ps(_mm256_max_ps(depth, least), most);
      const __m256 stored = _mm256_loadu_ps(row);
      const __m256 closer = _mm256_andnot_ps(outside, _mm256_cmp_ps(depth, stored, _CMP_GT_OQ));
      float* stored_ids = reinterpret_cast<float*>(ids);
      _mm256_storeu_ps(row, _mm256_blendv_ps(stored, depth, closer));
      _mm256_storeu_ps(stored_ids, _mm256_blendv_ps(_mm256_loadu_ps(stored_ids), new_id, closer));
      value_bc = _mm256_add_epi32(value_bc, down_bc);
      value_ca = _mm256_add_epi32(value_ca, down_ca);
      value_ab = _mm256_add_epi32(value_ab, down_ab);
      row += row_stride;
      ids += ids_stride;
    }
  }
}

// Narrows [*begin, *end), counted from the edge's pixel, to the pixels inside the edge.
inline void NarrowSpan(const Edge<int64_t>& edge, int64_t* begin, int64_t* end) {
  const int64_t value = edge.value, step = edge.step_x;
  if (step == 0) {
    if (value < 0) *end = *begin;
  } else if (step > 0) {
    if (value < 0) *begin = std::max(*begin, (-value + step - 1) / step);
  } else {
    *end = value < 0 ? *begin : std::min(*end, value / -step + 1);
  }
}

MPC_TARGET_AVX2 void FillLargeAvx2(const Prepared& p, int id, const RasterTarget& target) {
  Edge<int64_t> bc(p.b, p.c, p.x_begin, p.y_begin);
  Edge<int64_t> ca(p.c, p.a, p.x_begin, p.y_begin);
  Edge<int64_t> ab(p.a, p.b, p.x_begin, p.y_begin);
  const DepthPlane<double> plane(p);
  const __m128i lane = _mm_setr_epi32(0, kSubpixels, 2 * kSubpixels, 3 * kSubpixels);
  const __m256d step_x = _mm256_set1_pd(plane.step_x);
  const __m128 least = _mm_set1_ps(p.least), most = _mm_set1_ps(p.most);
  const __m128 new_id = _mm_castsi128_ps(_mm_set1_epi32(id));
  for (int y = p.y_begin; y <= p.y_last; ++y) {
    int64_t begin = 0, end = p.x_last + 1 - p.x_begin;
    for (const Edge<int64_t>* edge : {&bc, &ca, &ab}) NarrowSpan(*edge, &begin, &end);
    float* row = target.inverse_z + y * target.inverse_z_stride;
    int* ids = target.ids + y * target.ids_stride;
    const double row_depth = plane.AtRow(y);
    const int x_end = p.x_begin + static_cast<int>(end);
    int x = p.x_begin + static_cast<int>(begin);
    for (; x + 4 <= x_end; x += 4) {
      const __m256d dx =
          _mm256_cvtepi32_pd(_mm_add_epi32(_mm_set1_epi32(x * kSubpixels - plane.x), lane));
      __m128 depth =
          _mm256_cvtpd_ps(_mm256_add_pd(_mm256_set1_pd(row_depth), _mm256_mul_pd(dx, step_x)));
      depth = _mm_min_ps(_mm_max_ps(depth, least), most);
      const __m128 stored = _mm_loadu_ps(row + x);
      const __m128 closer = _mm_cmpgt_ps(depth, stored);
      _mm_storeu_ps(row + x, _mm_blendv_ps(stored, depth, closer));
      float* block_ids = reinterpret_cast<float*>(ids + x);
      _mm_storeu_ps(block_ids, _mm_blendv_ps(_mm_loadu_ps(block_ids), new_id, closer));
    }
    for (; x < x_end; ++x) {
      Draw(static_cast<float>(plane.At(row_depth, x)), p, id, &row[x], &ids[x]);
    }
    bc.value += bc.step_y;
    ca.value += ca.step_y;
    ab.value += ab.step_y;
  }
}

MPC_TARGET_AVX2 void FillTrianglesAvx2(const ScreenVertex* vertices, const int* corners, int count,
                                       int first_id, const RasterTarget& target) {
  Prepared p;
  for (int t = 0; t < count; ++t) {
    if (!Prepare(vertices, corners + 3 * t, target, &p)) continue;
    if (!p.small) {
      FillLargeAvx2(p, first_id + t, target);
      continue;
    }
    // Whole columns that do not reach beyond the row.
    const int num_columns = (p.x_last - p.x_begin + 8) / 8;
    const int x_first = std::min(p.x_begin, target.width - 8 * num_columns);
    if (x_first < 0) {
      FillPrepared(p, first_id + t, target);
    } else {
      FillSmallAvx2(p, first_id + t, target, x_first, num_columns);
    }
  }
}

}  // namespace

TriangleKernel BestTriangleKernel() {
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  return has_avx2 ? FillTrianglesAvx2 : FillTrianglesScalar;
}

#else

TriangleKernel BestTriangleKernel() { return FillTrianglesScalar; }

#endif

}  // namespace mpc
