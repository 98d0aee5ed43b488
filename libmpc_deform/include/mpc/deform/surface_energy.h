// Purpose: what the energies of the surface share: the rows they fill, block by block.
// Source: paper, Section 5.3, E_surf = E_con + w_arap E_arap. The variables are those of the warp
// field, D = {(R_i, t_i)}.
// Units: residuals in millimetres, or pixels of a picture whose longer side has 1920.
// Symbols: M nodes.
//
// An energy is a value class whose residuals come in blocks that depend on few nodes:
//   int num_blocks() const;
//   int rows() const;                              // residuals per block, 1 to 3
//   std::span<const int> nodes(int block) const;   // at most kMaxBlockNodes
//   bool Evaluate(const WarpField& at, int block, double* r, BlockJacobian* jacobian) const;
// Evaluate writes rows() entries of r and, if given, sizes and fills `jacobian`: rows() x 6 columns
// per node in the order of nodes(block), by a rotation (rad, R_i <- exp(omega) R_i) and a
// translation (m). The term's cost is the squared norm of its rows: weights are inside. Evaluate
// returns false outside the energy's domain.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace mpc {

constexpr int kMaxBlockNodes = 16;

using BlockJacobian =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, 3, 6 * kMaxBlockNodes>;

constexpr double kMillimetresPerMetre = 1000;

}  // namespace mpc
