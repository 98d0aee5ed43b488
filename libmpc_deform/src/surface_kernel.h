// Purpose: E_arap at a point, and the products with the normal equations and with their
// block-diagonal preconditioner, in which SolveSurface spends most of its time.
// Symbols: M nodes. A pair is 8 floats: rotation, 0, translation, 0.
#pragma once

namespace mpc {

// J^T J, and its damping, of E_surf at a point.
struct NormalEquations {
  int num_nodes;          // M
  const int* edge_begin;  // M+1: edges (i, j) by i
  const int* edge_node;   // j
  // Per edge a pair [l, m]: t_j x l and omega_j x m + twice_square t_j are taken from the product's
  // rotation and translation of node i.
  const float* levers;
  float twice_square;
  // Per node four pairs: columns of the 3x3 blocks (omega, omega) and (t, t), and [z, -z] with [z]x
  // the block (t, omega).
  const float* own;
  int num_rows;
  const int* row_begin;  // num_rows+1: nodes of a row of E_con
  const int* row_node;
  const float* rows;  // pairs
};

// E_arap's part of the normal equations at a point. Vectors of three are padded with a zero.
struct ArapPoint {
  int num_nodes;
  double scale;           // of the residuals
  const int* edge_begin;  // as above
  const int* edge_node;
  const int* edge_back;  // the edge (j, i)
  const double* rest;    // 4 per edge: g^_i - g^_j
  const double* turns;   // 12 per node: columns of R_i
  const double* shifts;  // 4 per node: t_i
};

// product = normal x and product = blocks x; x and product have M pairs. blocks: six pairs per node,
// the columns of its 6x6 block. The kernels for AVX2 give the same bits as those for any processor.
struct SurfaceKernel {
  void (*multiply)(const NormalEquations& normal, const float* x, float* product);
  void (*multiply_blocks)(int num_nodes, const float* blocks, const float* x, float* product);
  // gradient += J^T r, 8 per node; levers and own as in NormalEquations, undamped.
  void (*linearize)(const ArapPoint& at, double* gradient, float* levers, float* own);
};

SurfaceKernel PortableSurfaceKernel();
SurfaceKernel BestSurfaceKernel();  // of this processor

}  // namespace mpc
