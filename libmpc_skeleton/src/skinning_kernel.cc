#include "skinning_kernel.h"

#include <algorithm>
#include <cstddef>

#if defined(__x86_64__) && defined(__GNUC__)
#define MPC_AVX2_KERNEL 1
#include <immintrin.h>
#endif

namespace mpc {
namespace {

// Keeps a blend that cancelled out (only possible if the first influence weighs nothing) finite.
constexpr float kTinyNorm = 1e-20f;

float Dot4(const float* a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

}  // namespace

void SkinDualQuaternionPortable(const SkinningArrays& arrays, int begin) {
  const int num_influences = arrays.num_influences;
  for (int v = begin; v < arrays.num_vertices; ++v) {
    const int* segments = arrays.segments + static_cast<std::ptrdiff_t>(v) * num_influences;
    const float* weights = arrays.weights + static_cast<std::ptrdiff_t>(v) * num_influences;
    const float* pivot = arrays.motions + 8 * segments[0];
    float b[8] = {};
    for (int k = 0; k < num_influences; ++k) {
      const float* motion = arrays.motions + 8 * segments[k];
      const float weight = Dot4(motion, pivot) < 0 ? -weights[k] : weights[k];
      for (int i = 0; i < 8; ++i) b[i] += weight * motion[i];
    }
    // x' = x + 2 / |r|^2 (r x (r x x + w x) + w d - dw r + r x d) with real part (w, r) and dual
    // part (dw, d) of the blend: normalisation folded into one division.
    const float* x = arrays.positions + 3 * static_cast<std::ptrdiff_t>(v);
    const float scale = 2 / std::max(Dot4(b, b), kTinyNorm);
    const float inner_x = b[2] * x[2] - b[3] * x[1] + b[0] * x[0] + b[5];
    const float inner_y = b[3] * x[0] - b[1] * x[2] + b[0] * x[1] + b[6];
    const float inner_z = b[1] * x[1] - b[2] * x[0] + b[0] * x[2] + b[7];
    float* out = arrays.out + 3 * static_cast<std::ptrdiff_t>(v);
    out[0] = x[0] + scale * (b[2] * inner_z - b[3] * inner_y + b[0] * b[5] - b[4] * b[1]);
    out[1] = x[1] + scale * (b[3] * inner_x - b[1] * inner_z + b[0] * b[6] - b[4] * b[2]);
    out[2] = x[2] + scale * (b[1] * inner_y - b[2] * inner_x + b[0] * b[7] - b[4] * b[3]);
  }
}

#if MPC_AVX2_KERNEL

#define MPC_TARGET_AVX2 __attribute__((target("avx2,fma")))

namespace {

// Rows become columns.
MPC_TARGET_AVX2 inline void Transpose8(__m256 rows[8]) {
  __m256 t[8];
  for (int i = 0; i < 8; i += 2) {
    t[i] = _mm256_unpacklo_ps(rows[i], rows[i + 1]);
    t[i + 1] = _mm256_unpackhi_ps(rows[i], rows[i + 1]);
  }
  __m256 u[8];
  for (int i = 0; i < 8; i += 4) {
    u[i] = _mm256_shuffle_ps(t[i], t[i + 2], 0x44);
    u[i + 1] = _mm256_shuffle_ps(t[i], t[i + 2], 0xee);
    u[i + 2] = _mm256_shuffle_ps(t[i + 1], t[i + 3], 0x44);
    u[i + 3] = _mm256_shuffle_ps(t[i + 1], t[i + 3], 0xee);
  }
  for (int i = 0; i < 4; ++i) {
    rows[i] = _mm256_permute2f128_ps(u[i], u[i + 4], 0x20);
    rows[i + 4] = _mm256_permute2f128_ps(u[i], u[i + 4], 0x31);
  }
}

// Skins vertices v to v + 7. signs: S x S, the sign of each motion against each pivot.
MPC_TARGET_AVX2 inline void SkinEight(const SkinningArrays& arrays, const float* signs, int v) {
  const int num_influences = arrays.num_influences;
  const int* segments = arrays.segments + static_cast<std::ptrdiff_t>(v) * num_influences;
  const float* weights = arrays.weights + static_cast<std::ptrdiff_t>(v) * num_influences;
  __m256 b[8];
  for (int lane = 0; lane < 8; ++lane) {
    const float* sign = signs + segments[0] * arrays.num_segments;
    __m256 sum = _mm256_mul_ps(_mm256_set1_ps(weights[0]),
                               _mm256_loadu_ps(arrays.motions + 8 * segments[0]));
    for (int k = 1; k < num_influences; ++k) {
      const __m256 weight = _mm256_set1_ps(weights[k] * sign[segments[k]]);
      sum = _mm256_fmadd_ps(weight, _mm256_loadu_ps(arrays.motions + 8 * segments[k]), sum);
    }
    b[lane] = sum;
    segments += num_influences;
    weights += num_influences;
  }
  Transpose8(b);

  // Eight times x y z in three registers; each holds every third number of each coordinate.
  const float* positions = arrays.positions + 3 * static_cast<std::ptrdiff_t>(v);
  const __m256 p0 = _mm256_loadu_ps(positions);
  const __m256 p1 = _mm256_loadu_ps(positions + 8);
  const __m256 p2 = _mm256_loadu_ps(positions + 16);
  const __m256i to_x = _mm256_setr_epi32(0, 3, 6, 1, 4, 7, 2, 5);
  const __m256i to_y = _mm256_setr_epi32(1, 4, 7, 2, 5, 0, 3, 6);
  const __m256i to_z = _mm256_setr_epi32(2, 5, 0, 3, 6, 1, 4, 7);
  const __m256 x =
      _mm256_permutevar8x32_ps(_mm256_blend_ps(_mm256_blend_ps(p0, p1, 0x92), p2, 0x24), to_x);
  const __m256 y =
      _mm256_permutevar8x32_ps(_mm256_blend_ps(_mm256_blend_ps(p0, p1, 0x24), p2, 0x49), to_y);
  const __m256 z =
      _mm256_permutevar8x32_ps(_mm256_blend_ps(_mm256_blend_ps(p0, p1, 0x49), p2, 0x92), to_z);

  __m256 norm = _mm256_mul_ps(b[0], b[0]);
  for (int i = 1; i < 4; ++i) norm = _mm256_fmadd_ps(b[i], b[i], norm);
  const __m256 scale =
      _mm256_div_ps(_mm256_set1_ps(2), _mm256_max_ps(norm, _mm256_set1_ps(kTinyNorm)));
  // The same formula as in the portable loop.
  const __m256 inner_x =
      _mm256_fmadd_ps(b[2], z, _mm256_fnmadd_ps(b[3], y, _mm256_fmadd_ps(b[0], x, b[5])));
  const __m256 inner_y =
      _mm256_fmadd_ps(b[3], x, _mm256_fnmadd_ps(b[1], z, _mm256_fmadd_ps(b[0], y, b[6])));
  const __m256 inner_z =
      _mm256_fmadd_ps(b[1], y, _mm256_fnmadd_ps(b[2], x, _mm256_fmadd_ps(b[0], z, b[7])));
  const auto moved = [&](__m256 coordinate, int i, int j, __m256 inner_i, __m256 inner_j, int own)
                         MPC_TARGET_AVX2 {
                           __m256 sum = _mm256_mul_ps(b[i], inner_j);
                           sum = _mm256_fnmadd_ps(b[j], inner_i, sum);
                           sum = _mm256_fmadd_ps(b[0], b[own + 4], sum);
                           sum = _mm256_fnmadd_ps(b[4], b[own], sum);
                           return _mm256_fmadd_ps(scale, sum, coordinate);
                         };
  const __m256 out_x = moved(x, 2, 3, inner_y, inner_z, 1);
  const __m256 out_y = moved(y, 3, 1, inner_z, inner_x, 2);
  const __m256 out_z = moved(z, 1, 2, inner_x, inner_y, 3);

  const __m256i from_x = _mm256_setr_epi32(0, 3, 6, 1, 4, 7, 2, 5);
  const __m256i from_y = _mm256_setr_epi32(5, 0, 3, 6, 1, 4, 7, 2);
  const __m256i from_z = _mm256_setr_epi32(2, 5, 0, 3, 6, 1, 4, 7);
  const __m256 sx = _mm256_permutevar8x32_ps(out_x, from_x);
  const __m256 sy = _mm256_permutevar8x32_ps(out_y, from_y);
  const __m256 sz = _mm256_permutevar8x32_ps(out_z, from_z);
  float* out = arrays.out + 3 * static_cast<std::ptrdiff_t>(v);
  _mm256_storeu_ps(out, _mm256_blend_ps(_mm256_blend_ps(sx, sy, 0x92), sz, 0x24));
  _mm256_storeu_ps(out + 8, _mm256_blend_ps(_mm256_blend_ps(sx, sy, 0x24), sz, 0x49));
  _mm256_storeu_ps(out + 16, _mm256_blend_ps(_mm256_blend_ps(sx, sy, 0x49), sz, 0x92));
}

}  // namespace

bool HasAvx2Kernel() {
  static const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return has;
}

MPC_TARGET_AVX2 void SkinDualQuaternionAvx2(const SkinningArrays& arrays) {
  float signs[kMaxAvx2Segments * kMaxAvx2Segments];
  for (int pivot = 0; pivot < arrays.num_segments; ++pivot) {
    for (int s = 0; s < arrays.num_segments; ++s) {
      const bool negative = Dot4(arrays.motions + 8 * s, arrays.motions + 8 * pivot) < 0;
      signs[pivot * arrays.num_segments + s] = negative ? -1.0f : 1.0f;
    }
  }
  int v = 0;
  for (; v + 8 <= arrays.num_vertices; v += 8) SkinEight(arrays, signs, v);
  SkinDualQuaternionPortable(arrays, v);
}

#else

bool HasAvx2Kernel() { return false; }

void SkinDualQuaternionAvx2(const SkinningArrays& arrays) { SkinDualQuaternionPortable(arrays, 0); }

#endif

}  // namespace mpc
