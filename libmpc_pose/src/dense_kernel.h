// Purpose: the small dense products and inverses that the batch solver spends its time on, for
// processors with AVX2 where there is one (chosen at run time) and for any other.
// Symbols: matrices are column-major.
#pragma once

namespace mpc {

// Columns are `stride` numbers apart: their length and padding, a multiple of this.
inline constexpr int kRowBlock = 12;
inline int PaddedRows(int rows) { return (rows + kRowBlock - 1) / kRowBlock * kRowBlock; }

// y = A x for A with `columns` columns; y has `stride` numbers. It must not overlap the inputs.
void MultiplyColumns(int stride, int columns, const double* a, const double* x, double* y);

// Replaces a symmetric positive definite size x size matrix by its inverse; false when it is not
// positive definite. The padding of its columns must be finite; `scratch` has `stride` numbers.
bool InvertInPlace(int size, int stride, double* matrix, double* scratch);

// The same without AVX2: for tests.
void MultiplyColumnsPortable(int stride, int columns, const double* a, const double* x, double* y);
bool InvertInPlacePortable(int size, int stride, double* matrix, double* scratch);

}  // namespace mpc
