// Purpose: vectors of three floats as SIMD takes them, for the inside of SolveSurface.
#pragma once

#include <Eigen/Core>

namespace mpc {

// Columns of floats that end in a zero. A vector of unknowns has two columns per node: rotation,
// translation.
using Packed = Eigen::Matrix<float, 4, Eigen::Dynamic>;

// A column, as the compilers know it for any processor: Eigen's cross3 of such vectors is not SIMD
// everywhere.
using Float4 = float __attribute__((vector_size(16), may_alias));

inline Float4 Cross(Float4 a, Float4 b) {
  const Float4 a_next = __builtin_shufflevector(a, a, 1, 2, 0, 3);
  const Float4 b_next = __builtin_shufflevector(b, b, 1, 2, 0, 3);
  const Float4 turned = a * b_next - a_next * b;
  return __builtin_shufflevector(turned, turned, 1, 2, 0, 3);
}

inline const Float4* Columns(const Packed& x) { return reinterpret_cast<const Float4*>(x.data()); }
inline Float4* Columns(Packed* x) { return reinterpret_cast<Float4*>(x->data()); }

}  // namespace mpc
