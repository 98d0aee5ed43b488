#include "surface_kernel.h"

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
#endif

}  // namespace

SurfaceKernel PortableSurfaceKernel() { return {MultiplyPortable, MultiplyBlocksPortable}; }

SurfaceKernel BestSurfaceKernel() {
#if MPC_AVX2_KERNEL
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) return {MultiplyAvx2, MultiplyBlocksAvx2};
#endif
  return PortableSurfaceKernel();
}

}  // namespace mpc
