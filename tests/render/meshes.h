// Purpose: meshes that the rendering tests share.
// Frames: camera frame (x right, y down, z forward).
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>

#include "mpc/core/triangle_mesh.h"

namespace mpc::testing {

// A closed ball with one vertex per pole, counter-clockwise seen from outside.
inline TriangleMesh Ball(const Eigen::Vector3d& centre, double radius, int rings = 60,
                         int sides = 80) {
  TriangleMesh mesh;
  mesh.positions.resize(3, rings * sides + 2);
  mesh.triangles.resize(3, 2 * rings * sides);
  const auto place = [&](int v, double polar, double around) {
    const Eigen::Vector3d normal(std::sin(polar) * std::cos(around), std::cos(polar),
                                 std::sin(polar) * std::sin(around));
    mesh.positions.col(v) = (centre + radius * normal).cast<float>();
  };
  const int top = rings * sides, bottom = top + 1;
  place(top, 0, 0);
  place(bottom, M_PI, 0);
  int t = 0;
  for (int r = 0; r < rings; ++r) {
    for (int i = 0; i < sides; ++i) {
      place(r * sides + i, M_PI * (r + 1) / (rings + 1), 2 * M_PI * i / sides);
      const int here = r * sides + i, next = r * sides + (i + 1) % sides;
      if (r == 0) mesh.triangles.col(t++) << top, next, here;
      if (r + 1 == rings) {
        mesh.triangles.col(t++) << bottom, here, next;
      } else {
        mesh.triangles.col(t++) << here, next, here + sides;
        mesh.triangles.col(t++) << next, next + sides, here + sides;
      }
    }
  }
  return mesh;
}

// Both meshes as one.
inline TriangleMesh Joined(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh mesh;
  mesh.positions.resize(3, a.positions.cols() + b.positions.cols());
  mesh.positions << a.positions, b.positions;
  mesh.triangles.resize(3, a.triangles.cols() + b.triangles.cols());
  mesh.triangles << a.triangles,
      (b.triangles.array() + static_cast<int>(a.positions.cols())).matrix();
  return mesh;
}

// Triangles that share vertices at random: open, non-manifold, intersecting, both orientations.
inline TriangleMesh Tangle(int num_vertices, int num_triangles, double spread,
                           const Eigen::Vector3d& centre, std::mt19937_64* random) {
  std::normal_distribution<double> offset(0, spread);
  std::uniform_int_distribution<int> vertex(0, num_vertices - 1);
  TriangleMesh mesh;
  mesh.positions.resize(3, num_vertices);
  mesh.triangles.resize(3, num_triangles);
  for (float& x : mesh.positions.reshaped()) x = static_cast<float>(offset(*random));
  mesh.positions.colwise() += centre.cast<float>();
  for (int& v : mesh.triangles.reshaped()) v = vertex(*random);
  return mesh;
}

}  // namespace mpc::testing
