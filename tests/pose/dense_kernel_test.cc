// The kernels against Eigen, and each against its portable twin.
#include "dense_kernel.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class DenseKernelTest : public ::testing::TestWithParam<int> {
 protected:
  // The upper rows are random, the padding is zero.
  MatrixXd Random(int columns) {
    MatrixXd matrix = MatrixXd::Zero(PaddedRows(GetParam()), columns);
    for (double& x : matrix.topRows(GetParam()).reshaped()) x = normal_(rng_);
    return matrix;
  }

 private:
  std::mt19937 rng_{3};
  std::normal_distribution<double> normal_;
};

TEST_P(DenseKernelTest, MultipliesAsEigenDoes) {
  const int stride = PaddedRows(GetParam());
  for (const int columns : {1, 21, 50}) {
    const MatrixXd a = Random(columns);
    const VectorXd x = VectorXd::LinSpaced(columns, -1, 2);
    VectorXd y = VectorXd::Constant(stride, 7);
    VectorXd twin = y;
    MultiplyColumns(stride, columns, a.data(), x.data(), y.data());
    MultiplyColumnsPortable(stride, columns, a.data(), x.data(), twin.data());
    EXPECT_LT((y - a * x).norm(), 1e-12);
    EXPECT_LT((twin - a * x).norm(), 1e-12);
  }
}

TEST_P(DenseKernelTest, InvertsAsEigenDoes) {
  const int size = GetParam();
  const MatrixXd root = Random(size).topRows(size);
  MatrixXd matrix = MatrixXd::Zero(PaddedRows(size), size);
  matrix.topRows(size) = root * root.transpose() + MatrixXd::Identity(size, size);
  const MatrixXd expected = matrix.topRows(size).inverse();
  MatrixXd twin = matrix;
  VectorXd scratch(matrix.rows());
  ASSERT_TRUE(InvertInPlace(size, PaddedRows(size), matrix.data(), scratch.data()));
  ASSERT_TRUE(InvertInPlacePortable(size, PaddedRows(size), twin.data(), scratch.data()));
  for (const MatrixXd& inverse : {matrix, twin}) {
    EXPECT_LT((inverse.topRows(size) - expected).norm(), 1e-10 * expected.norm());
    EXPECT_TRUE(inverse.bottomRows(inverse.rows() - size).isZero());
  }
}

TEST_P(DenseKernelTest, RefusesWhatIsNotPositiveDefinite) {
  const int size = GetParam();
  for (const double pivot : {0.0, -1.0, std::nan("")}) {
    MatrixXd matrix = MatrixXd::Identity(PaddedRows(size), size);
    matrix(size / 2, size / 2) = pivot;
    MatrixXd twin = matrix;
    VectorXd scratch(matrix.rows());
    EXPECT_FALSE(InvertInPlace(size, PaddedRows(size), matrix.data(), scratch.data()));
    EXPECT_FALSE(InvertInPlacePortable(size, PaddedRows(size), twin.data(), scratch.data()));
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, DenseKernelTest, ::testing::Values(1, 11, 12, 33, 36, 50));

}  // namespace
}  // namespace mpc
