// Purpose: the linear trajectory subspace that couples the frames of a batch.
// Source: paper, Section 4, Eq. (dct): K lowest DCT vectors; DCT-II, orthonormal.
// Symbols: K basis vectors, F frames of the batch.
#pragma once

#include <Eigen/Core>

namespace mpc {

// The K x F matrix D whose rows are the K lowest-frequency orthonormal DCT-II vectors of length F:
// D D^T = I. K is clamped to [1, F]. Throws Error (kInvalidArgument) for F < 1.
Eigen::MatrixXd DctBasis(int num_vectors, int num_frames);

// Number of vectors that keeps motion up to `cutoff_hz`: K = 1 + 2 F cutoff / fps, at least 2 (for
// F >= 2) and at most F. DCT vector k of F frames has frequency k fps / (2 F).
int BasisSize(int num_frames, double fps, double cutoff_hz);

// The orthonormal complement of the rows of `basis`, (F-K) x F: "Null(DCT)" of the paper, transposed.
Eigen::MatrixXd BasisComplement(const Eigen::MatrixXd& basis);

// Empirical Bayes weights of the subspace's coefficients: the penalty on coefficient k of dof n that
// is optimal when its variance is what `coefficients` (N x K, of an earlier solution) show, averaged
// over neighbouring k, and noise of variance noise_cost (the cost of one typical error) lies on the
// data. Returns N x K shares of `weights` (N), in [0, max_share]; k = 0 is free.
Eigen::MatrixXd AdaptedShares(const Eigen::MatrixXd& coefficients, const Eigen::VectorXd& weights,
                              double noise_cost, double max_share);

}  // namespace mpc
