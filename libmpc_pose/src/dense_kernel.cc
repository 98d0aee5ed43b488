#include "dense_kernel.h"

#include <cstddef>

#if defined(__x86_64__) && defined(__GNUC__)
#define MPC_AVX2_KERNEL 1
#endif

#define MPC_INLINE inline __attribute__((always_inline))

namespace mpc {
namespace {

// Numbers at any address that one instruction takes, and how many such lanes of sums the registers hold.
struct Portable {
  typedef double Lane __attribute__((vector_size(16), aligned(8), may_alias));
  static constexpr int kMaxLanes = 6;
};
struct Avx2 {
  typedef double Lane __attribute__((vector_size(32), aligned(8), may_alias));
  static constexpr int kMaxLanes = 9;
};

template <typename Isa>
inline constexpr int kLane = sizeof(typename Isa::Lane) / sizeof(double);

template <typename Isa>
MPC_INLINE typename Isa::Lane& At(double* p, int lane) {
  return *reinterpret_cast<typename Isa::Lane*>(p + lane * kLane<Isa>);
}
template <typename Isa>
MPC_INLINE const typename Isa::Lane& At(const double* p, int lane) {
  return *reinterpret_cast<const typename Isa::Lane*>(p + lane * kLane<Isa>);
}

// kLanes lanes of rows of A x.
template <typename Isa, int kLanes>
MPC_INLINE void MultiplyRows(int stride, int columns, const double* a, const double* x, double* y) {
  typename Isa::Lane sum[kLanes] = {};
  for (int j = 0; j < columns; ++j, a += stride) {
#pragma GCC unroll 9
    for (int i = 0; i < kLanes; ++i) sum[i] += At<Isa>(a, i) * x[j];
  }
#pragma GCC unroll 9
  for (int i = 0; i < kLanes; ++i) At<Isa>(y, i) = sum[i];
}

template <typename Isa>
MPC_INLINE void MultiplyBody(int stride, int columns, const double* a, const double* x, double* y) {
  constexpr int kMaxRows = Isa::kMaxLanes * kLane<Isa>;
  int row = 0;
  for (; row + kMaxRows <= stride; row += kMaxRows) {
    MultiplyRows<Isa, Isa::kMaxLanes>(stride, columns, a + row, x, y + row);
  }
  for (; row < stride; row += kRowBlock) {
    MultiplyRows<Isa, kRowBlock / kLane<Isa>>(stride, columns, a + row, x, y + row);
  }
}

// The sweep operator. The last rows go first: a skeleton's limbs do not touch one another, so that
// most columns are not touched by their pivots. kFixedLanes: lanes of a column, 0 if not known.
template <typename Isa, int kFixedLanes>
MPC_INLINE bool SweepBody(int size, int stride, double* matrix, double* pivot_column) {
  const std::ptrdiff_t step = stride;
  const int lanes = kFixedLanes > 0 ? kFixedLanes : stride / kLane<Isa>;
  for (int k = size - 1; k >= 0; --k) {
    double* const of_pivot = matrix + k * step;
    for (int i = 0; i < lanes; ++i) At<Isa>(pivot_column, i) = At<Isa>(of_pivot, i);
    const double pivot = pivot_column[k];
    if (!(pivot > 0)) return false;
    const double inverse = 1 / pivot;
    for (int j = 0; j < size; ++j) {
      if (pivot_column[j] == 0 || j == k) continue;
      const double factor = pivot_column[j] * inverse;
      double* const column = matrix + j * step;
#pragma GCC unroll 9
      for (int i = 0; i < lanes; ++i) At<Isa>(column, i) -= factor * At<Isa>(pivot_column, i);
      column[k] = factor;
    }
    for (int i = 0; i < lanes; ++i) At<Isa>(of_pivot, i) *= inverse;
    of_pivot[k] = -inverse;
  }
  for (int i = 0; i < size * lanes; ++i) At<Isa>(matrix, i) = -At<Isa>(matrix, i);
  return true;
}

template <typename Isa>
MPC_INLINE bool InvertBody(int size, int stride, double* matrix, double* scratch) {
  constexpr int kUsualLanes = 3 * kRowBlock / kLane<Isa>;  // of the default skeleton's 33 dofs
  return stride == 3 * kRowBlock ? SweepBody<Isa, kUsualLanes>(size, stride, matrix, scratch)
                                 : SweepBody<Isa, 0>(size, stride, matrix, scratch);
}

#if MPC_AVX2_KERNEL
__attribute__((target("avx2,fma"))) void MultiplyAvx2(int stride, int columns, const double* a,
                                                      const double* x, double* y) {
  MultiplyBody<Avx2>(stride, columns, a, x, y);
}
__attribute__((target("avx2,fma"))) bool InvertAvx2(int size, int stride, double* matrix,
                                                    double* scratch) {
  return InvertBody<Avx2>(size, stride, matrix, scratch);
}
bool HasAvx2() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
#endif

}  // namespace

void MultiplyColumnsPortable(int stride, int columns, const double* a, const double* x, double* y) {
  MultiplyBody<Portable>(stride, columns, a, x, y);
}

bool InvertInPlacePortable(int size, int stride, double* matrix, double* scratch) {
  return InvertBody<Portable>(size, stride, matrix, scratch);
}

void MultiplyColumns(int stride, int columns, const double* a, const double* x, double* y) {
#if MPC_AVX2_KERNEL
  if (HasAvx2()) return MultiplyAvx2(stride, columns, a, x, y);
#endif
  MultiplyColumnsPortable(stride, columns, a, x, y);
}

bool InvertInPlace(int size, int stride, double* matrix, double* scratch) {
#if MPC_AVX2_KERNEL
  if (HasAvx2()) return InvertAvx2(size, stride, matrix, scratch);
#endif
  return InvertInPlacePortable(size, stride, matrix, scratch);
}

}  // namespace mpc
