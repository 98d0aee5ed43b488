// Purpose: the inner loop of dual-quaternion skinning on raw arrays.
// Source: Kavan et al. 2007.
// Symbols: S segments, V vertices, K influences.
//
// positions and out hold x y z per vertex, segments and weights K numbers per vertex, motions 8
// floats per segment (real w x y z, dual w x y z). Arrays may be unaligned and must not overlap.
#pragma once

namespace mpc {

struct SkinningArrays {
  const float* positions;
  const int* segments;
  const float* weights;
  const float* motions;
  float* out;
  int num_vertices;
  int num_influences;
  int num_segments;
};

// Skins vertices [begin, num_vertices).
void SkinDualQuaternionPortable(const SkinningArrays& arrays, int begin);

// Most segments the AVX2 kernel takes.
inline constexpr int kMaxAvx2Segments = 64;

// Whether this machine runs SkinDualQuaternionAvx2.
bool HasAvx2Kernel();

// Skins all vertices, eight at a time. Call only if HasAvx2Kernel() and num_segments is in range.
void SkinDualQuaternionAvx2(const SkinningArrays& arrays);

}  // namespace mpc
