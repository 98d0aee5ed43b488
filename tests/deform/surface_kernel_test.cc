// The products of the surface solver: any processor's kernel against a dense matrix, and AVX2's
// against it, bit by bit.
#include "surface_kernel.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <random>
#include <vector>

namespace mpc {
namespace {

// Nodes in a ring, two rows of three nodes each, random numbers.
struct Problem {
  static constexpr int kNodes = 7;

  Problem() {
    edge_begin.push_back(0);
    for (int i = 0; i < kNodes; ++i) {
      edge_node.push_back((i + 1) % kNodes);
      edge_node.push_back((i + kNodes - 1) % kNodes);
      edge_begin.push_back(static_cast<int>(edge_node.size()));
    }
    levers = Pairs(edge_node.size());
    own = Pairs(4 * kNodes);
    rows = Pairs(row_node.size());
    blocks = Pairs(6 * kNodes);
    x = Pairs(kNodes);
    normal = {kNodes, edge_begin.data(), edge_node.data(), levers.data(), 0.7f, own.data(),
              2,      row_begin.data(),  row_node.data(),  rows.data()};
  }

  std::vector<float> Pairs(size_t count) {
    std::vector<float> values(8 * count);
    for (size_t i = 0; i < values.size(); ++i) {
      if (i % 4 != 3) values[i] = std::uniform_real_distribution<float>(-1, 1)(rng);
    }
    return values;
  }

  std::mt19937 rng{1};
  std::vector<int> edge_begin, edge_node;
  std::vector<int> row_begin = {0, 3, 6}, row_node = {0, 3, 5, 1, 3, 6};
  std::vector<float> levers, own, rows, blocks, x;
  NormalEquations normal;
};

Eigen::Vector3f At(const std::vector<float>& pairs, int pair, int half) {
  return Eigen::Map<const Eigen::Vector3f>(&pairs[static_cast<size_t>(8 * pair + 4 * half)]);
}

TEST(SurfaceKernelTest, MultipliesAsItsHeaderSays) {
  const Problem p;
  std::vector<float> product(p.x.size());
  PortableSurfaceKernel().multiply(p.normal, p.x.data(), product.data());
  for (int i = 0; i < Problem::kNodes; ++i) {
    const Eigen::Vector3f omega = At(p.x, i, 0), t = At(p.x, i, 1);
    Eigen::Vector3f by_omega = t.cross(At(p.own, 4 * i + 3, 0));
    Eigen::Vector3f by_t = omega.cross(At(p.own, 4 * i + 3, 1));
    for (int c = 0; c < 3; ++c) {
      by_omega += omega[c] * At(p.own, 4 * i + c, 0);
      by_t += t[c] * At(p.own, 4 * i + c, 1);
    }
    for (int e = p.edge_begin[i]; e < p.edge_begin[i + 1]; ++e) {
      const int j = p.edge_node[e];
      by_omega -= At(p.x, j, 1).cross(At(p.levers, e, 0));
      by_t -= At(p.x, j, 0).cross(At(p.levers, e, 1)) + p.normal.twice_square * At(p.x, j, 1);
    }
    for (int r = 0; r < 2; ++r) {
      float change = 0;
      for (int k = p.row_begin[r]; k < p.row_begin[r + 1]; ++k) {
        change += At(p.rows, k, 0).dot(At(p.x, p.row_node[k], 0)) +
                  At(p.rows, k, 1).dot(At(p.x, p.row_node[k], 1));
      }
      for (int k = p.row_begin[r]; k < p.row_begin[r + 1]; ++k) {
        if (p.row_node[k] != i) continue;
        by_omega += change * At(p.rows, k, 0);
        by_t += change * At(p.rows, k, 1);
      }
    }
    EXPECT_LT((At(product, i, 0) - by_omega).norm(), 1e-5) << i;
    EXPECT_LT((At(product, i, 1) - by_t).norm(), 1e-5) << i;
    EXPECT_EQ(product[8 * i + 3], 0);
    EXPECT_EQ(product[8 * i + 7], 0);
  }
}

TEST(SurfaceKernelTest, TwinsGiveTheSameBits) {
  const Problem p;
  std::vector<float> portable(p.x.size()), best(p.x.size());
  PortableSurfaceKernel().multiply(p.normal, p.x.data(), portable.data());
  BestSurfaceKernel().multiply(p.normal, p.x.data(), best.data());
  EXPECT_EQ(portable, best);
  PortableSurfaceKernel().multiply_blocks(Problem::kNodes, p.blocks.data(), p.x.data(),
                                          portable.data());
  BestSurfaceKernel().multiply_blocks(Problem::kNodes, p.blocks.data(), p.x.data(), best.data());
  EXPECT_EQ(portable, best);
  for (int i = 0; i < Problem::kNodes; ++i) {
    Eigen::Vector3f expected = Eigen::Vector3f::Zero();
    for (int c = 0; c < 6; ++c) {
      expected += p.x[8 * i + c + (c >= 3)] * At(p.blocks, 6 * i + c, 1);
    }
    EXPECT_LT((At(best, i, 1) - expected).norm(), 1e-5) << i;
  }
}

// One edge there and back, against the residuals' own Jacobians.
TEST(SurfaceKernelTest, LinearizesAsItsHeaderSays) {
  std::mt19937 rng(2);
  const auto random = [&](int rows, int cols) {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(
        rows, cols, [&] { return std::uniform_real_distribution<double>(-1, 1)(rng); }));
  };
  const int edge_begin[] = {0, 1, 2}, edge_node[] = {1, 0}, edge_back[] = {1, 0};
  const double scale = 0.7;
  Eigen::MatrixXd rest = random(4, 2), turns = random(4, 6), shifts = random(4, 2);
  rest.col(1) = -rest.col(0);
  for (Eigen::MatrixXd* padded : {&rest, &turns, &shifts}) padded->row(3).setZero();
  const ArapPoint at = {2,         scale,       edge_begin,   edge_node,
                        edge_back, rest.data(), turns.data(), shifts.data()};
  Eigen::MatrixXd gradient = Eigen::MatrixXd::Zero(8, 2), gradient_best = gradient;
  std::vector<float> levers(16), own(64), levers_best(16), own_best(64);
  PortableSurfaceKernel().linearize(at, gradient.data(), levers.data(), own.data());
  BestSurfaceKernel().linearize(at, gradient_best.data(), levers_best.data(), own_best.data());
  EXPECT_EQ(gradient, gradient_best);
  EXPECT_EQ(levers, levers_best);
  EXPECT_EQ(own, own_best);

  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6, 12);  // omega and t of both nodes
  Eigen::VectorXd r(6);
  Eigen::Vector3d y[2];
  for (int i = 0; i < 2; ++i) {
    const Eigen::Matrix3d turn = turns.block<3, 3>(0, 3 * i);
    y[i] = scale * turn * rest.col(i).head<3>();
    r.segment<3>(3 * i) =
        scale * (rest.col(i) + shifts.col(i) - shifts.col(1 - i)).head<3>() - y[i];
    for (int c = 0; c < 3; ++c) {
      jacobian.block<3, 1>(3 * i, 6 * i + c) = y[i].cross(Eigen::Vector3d::Unit(c));
    }
    jacobian.block<3, 3>(3 * i, 6 * i + 3) = scale * Eigen::Matrix3d::Identity();
    jacobian.block<3, 3>(3 * i, 6 * (1 - i) + 3) = -scale * Eigen::Matrix3d::Identity();
  }
  const Eigen::VectorXd by_all = jacobian.transpose() * r;
  const Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
  for (int i = 0; i < 2; ++i) {
    EXPECT_LT((gradient.col(i).head<3>() - by_all.segment<3>(6 * i)).norm(), 1e-12);
    EXPECT_LT((gradient.col(i).segment<3>(4) - by_all.segment<3>(6 * i + 3)).norm(), 1e-12);
    EXPECT_LT((At(levers, i, 0) - (scale * y[i]).cast<float>()).norm(), 1e-6);
    EXPECT_LT((At(levers, i, 1) + (scale * y[1 - i]).cast<float>()).norm(), 1e-6);
    const Eigen::Vector3f z = At(own, 4 * i + 3, 0);
    for (int c = 0; c < 3; ++c) {
      const Eigen::VectorXf column = normal.block<6, 1>(6 * i, 6 * i + c).cast<float>();
      EXPECT_LT((At(own, 4 * i + c, 0) - column.head<3>()).norm(), 1e-6);
      EXPECT_LT((z.cross(Eigen::Vector3f::Unit(c)) - column.tail<3>()).norm(), 1e-6);
      EXPECT_LT((At(own, 4 * i + c, 1) - normal.block<3, 1>(6 * i + 3, 6 * i + 3 + c).cast<float>())
                    .norm(),
                1e-6);
    }
    EXPECT_EQ(z, -At(own, 4 * i + 3, 1));
  }
}

}  // namespace
}  // namespace mpc
