#include "surface_kernel.h"

#include <cstddef>

#if defined(__x86_64__) && defined(__GNUC__)
#define MPC_AVX2_KERNEL 1
#endif

// A pair in one register or two; no function below is called, they are all inlined.
#pragma GCC diagnostic ignored "-Wpsabi"
#define MPC_INLINE inline __attribute__((always_inline))

namespace mpc {
namespace {

using Pair = float __attribute__((vector_size(32), may_alias, aligned(4)));

MPC_INLINE const Pair* Pairs(const float* x) { return reinterpret_cast<const Pair*>(x); }
MPC_INLINE Pair* Pairs(float* x) { return reinterpret_cast<Pair*>(x); }

MPC_INLINE Pair Swapped(const Pair& x) {
  return __builtin_shufflevector(x, x, 4, 5, 6, 7, 0, 1, 2, 3);
}

// Each half's entries moved on by one: a x b = Next(a Next(b) - Next(a) b).
MPC_INLINE Pair Next(const Pair& x) {
  return __builtin_shufflevector(x, x, 1, 2, 0, 3, 5, 6, 4, 7);
}

template <int kEntry>
MPC_INLINE Pair Spread(const Pair& x) {
  constexpr int a = kEntry, b = 4 + kEntry;
  return __builtin_shufflevector(x, x, a, a, a, a, b, b, b, b);
}

MPC_INLINE void Multiply(const NormalEquations& normal, const float* x, float* product) {
  const Pair* in = Pairs(x);
  Pair* out = Pairs(product);
  for (int i = 0; i < normal.num_nodes; ++i) {
    const Pair own = in[i];
    const Pair* block = Pairs(normal.own) + 4 * i;
    Pair sum = Spread<0>(own) * block[0] + Spread<1>(own) * block[1] + Spread<2>(own) * block[2];
    const Pair swapped = Swapped(own);
    Pair crossed = swapped * Next(block[3]) - Next(swapped) * block[3];
    Pair neighbors = {};
    for (int e = normal.edge_begin[i]; e < normal.edge_begin[i + 1]; ++e) {
      const Pair other = in[normal.edge_node[e]];
      const Pair lever = Pairs(normal.levers)[e];
      const Pair other_swapped = Swapped(other);
      neighbors += other;
      crossed -= other_swapped * Next(lever) - Next(other_swapped) * lever;
    }
    const float s = normal.twice_square;
    sum -= neighbors * Pair{0, 0, 0, 0, s, s, s, 0};
    out[i] = sum + Next(crossed);
  }
  const Pair* row = Pairs(normal.rows);
  for (int r = 0; r < normal.num_rows; ++r) {
    Pair change = {};
    for (int k = normal.row_begin[r]; k < normal.row_begin[r + 1]; ++k) {
      change += row[k] * in[normal.row_node[k]];
    }
    const float sum = (change[0] + change[1] + change[2]) + (change[4] + change[5] + change[6]);
    for (int k = normal.row_begin[r]; k < normal.row_begin[r + 1]; ++k) {
      out[normal.row_node[k]] += sum * row[k];
    }
  }
}

MPC_INLINE void MultiplyBlocks(int num_nodes, const float* blocks, const float* x, float* product) {
  const Pair* block = Pairs(blocks);
  for (int i = 0; i < num_nodes; ++i, block += 6, x += 8) {
    Pairs(product)[i] = x[0] * block[0] + x[1] * block[1] + x[2] * block[2] + x[4] * block[3] +
                        x[5] * block[4] + x[6] * block[5];
  }
}

using Double4 = double __attribute__((vector_size(32), may_alias, aligned(8)));
using Float4 = float __attribute__((vector_size(16), may_alias, aligned(4)));

MPC_INLINE const Double4* Fours(const double* x) { return reinterpret_cast<const Double4*>(x); }
MPC_INLINE Double4* Fours(double* x) { return reinterpret_cast<Double4*>(x); }

MPC_INLINE Double4 Next(const Double4& x) { return __builtin_shufflevector(x, x, 1, 2, 0, 3); }

template <int kEntry>
MPC_INLINE Double4 Spread(const Double4& x) {
  return __builtin_shufflevector(x, x, kEntry, kEntry, kEntry, kEntry);
}

// With y = scale R_i (g^_i - g^_j), the Jacobian of an edge's residual r by (omega_i, t_i, t_j) is
// ([y]x, scale, -scale).
MPC_INLINE void Linearize(const ArapPoint& at, double* gradient, float* levers, float* own) {
  const auto rounded = [](const Double4& x) { return __builtin_convertvector(x, Float4); };
  const double scale = at.scale;
  Double4* by_node = Fours(gradient);
  Float4* lever = reinterpret_cast<Float4*>(levers);
  Float4* block = reinterpret_cast<Float4*>(own);
  for (std::ptrdiff_t i = 0; i < at.num_nodes; ++i, block += 8) {
    const Double4* turn = Fours(at.turns) + 3 * i;
    const Double4 shift = Fours(at.shifts)[i];
    Double4 sum_y = {}, sum_r = {}, crossed = {}, yy0 = {}, yy1 = {}, yy2 = {};
    for (std::ptrdiff_t e = at.edge_begin[i]; e < at.edge_begin[i + 1]; ++e) {
      const std::ptrdiff_t j = at.edge_node[e], back = at.edge_back[e];
      const Double4 rest = Fours(at.rest)[e];
      const Double4 y = scale * (Spread<0>(rest) * turn[0] + Spread<1>(rest) * turn[1] +
                                 Spread<2>(rest) * turn[2]);
      const Double4 r = scale * (rest + shift - Fours(at.shifts)[j]) - y;
      sum_y += y;
      sum_r += r;
      crossed += r * Next(y) - Next(r) * y;
      yy0 += Spread<0>(y) * y;
      yy1 += Spread<1>(y) * y;
      yy2 += Spread<2>(y) * y;
      by_node[2 * j + 1] -= scale * r;
      const Float4 scaled = rounded(scale * y);
      lever[2 * e] = scaled;
      lever[2 * back + 1] = -scaled;
    }
    by_node[2 * i] += Next(crossed);
    by_node[2 * i + 1] += scale * sum_r;
    const double trace = yy0[0] + yy1[1] + yy2[2];
    const double twice = 2 * scale * scale * (at.edge_begin[i + 1] - at.edge_begin[i]);
    block[0] = rounded(Double4{trace, 0, 0, 0} - yy0);
    block[1] = rounded(Double4{twice, 0, 0, 0});
    block[2] = rounded(Double4{0, trace, 0, 0} - yy1);
    block[3] = rounded(Double4{0, twice, 0, 0});
    block[4] = rounded(Double4{0, 0, trace, 0} - yy2);
    block[5] = rounded(Double4{0, 0, twice, 0});
    block[6] = rounded(scale * sum_y);
    block[7] = -block[6];
  }
}

void LinearizePortable(const ArapPoint& at, double* gradient, float* levers, float* own) {
  Linearize(at, gradient, levers, own);
}
void MultiplyPortable(const NormalEquations& normal, const float* x, float* product) {
  Multiply(normal, x, product);
}
void MultiplyBlocksPortable(int num_nodes, const float* blocks, const float* x, float* product) {
  MultiplyBlocks(num_nodes, blocks, x, product);
}

#if MPC_AVX2_KERNEL
// Without FMA, so that no product is rounded differently.
__attribute__((target("avx2"))) void MultiplyAvx2(const NormalEquations& normal, const float* x,
                                                  float* product) {
  Multiply(normal, x, product);
}
__attribute__((target("avx2"))) void MultiplyBlocksAvx2(int num_nodes, const float* blocks,
                                                        const float* x, float* product) {
  MultiplyBlocks(num_nodes, blocks, x, product);
}
__attribute__((target("avx2"))) void LinearizeAvx2(const ArapPoint& at, double* gradient,
                                                   float* levers, float* own) {
  Linearize(at, gradient, levers, own);
}
#endif

}  // namespace

SurfaceKernel PortableSurfaceKernel() {
  return {MultiplyPortable, MultiplyBlocksPortable, LinearizePortable};
}

SurfaceKernel BestSurfaceKernel() {
#if MPC_AVX2_KERNEL
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) return {MultiplyAvx2, MultiplyBlocksAvx2, LinearizeAvx2};
#endif
  return PortableSurfaceKernel();
}

}  // namespace mpc
