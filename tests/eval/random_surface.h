// Purpose: triangles that share vertices in no particular order, and points around them.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <random>

#include "mpc/core/triangle_mesh.h"

namespace mpc::testing {

struct RandomSurface {
  RandomSurface(int num_triangles, std::uint64_t seed) : random(seed) {
    const int num_vertices = std::max(3, num_triangles / 2);
    positions = Eigen::Matrix3Xf::NullaryExpr(3, num_vertices,
                                              [&] { return static_cast<float>(normal(random)); });
    std::uniform_int_distribution<int> vertex(0, num_vertices - 1);
    triangles = Triangles::NullaryExpr(3, num_triangles, [&] { return vertex(random); });
  }
  Eigen::Vector3d RandomPoint() {
    return Eigen::Vector3d::NullaryExpr([&] { return normal(random); });
  }

  std::mt19937_64 random;
  std::normal_distribution<double> normal{0, 0.5};
  Eigen::Matrix3Xf positions;
  Triangles triangles;
};

}  // namespace mpc::testing
