// Purpose: meshes that the tests of graph and surface share.
// Frames: camera frame (x right, y down, z forward).
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "mpc/core/triangle_mesh.h"
#include "render/meshes.h"

namespace mpc::testing {

// A tube about the y axis through `centre`, open at both ends, outward normals; its radius runs
// from `top` (least y) to `bottom`.
inline TriangleMesh Tube(const Eigen::Vector3d& centre, double height, double top, double bottom,
                         int rings = 40, int sides = 60) {
  TriangleMesh mesh;
  mesh.positions.resize(3, rings * sides);
  mesh.triangles.resize(3, 2 * (rings - 1) * sides);
  int t = 0;
  for (int r = 0; r < rings; ++r) {
    const double u = static_cast<double>(r) / (rings - 1);
    const double radius = top + u * (bottom - top);
    for (int i = 0; i < sides; ++i) {
      const double around = 2 * M_PI * i / sides;
      const Eigen::Vector3d x(radius * std::cos(around), height * (u - 0.5),
                              radius * std::sin(around));
      const int here = r * sides + i, next = r * sides + (i + 1) % sides;
      mesh.positions.col(here) = (centre + x).cast<float>();
      if (r + 1 == rings) continue;
      mesh.triangles.col(t++) << here, here + sides, next;
      mesh.triangles.col(t++) << next, here + sides, next + sides;
    }
  }
  return mesh;
}

// A closed trunk with a skirt that does not touch it: two components, one with boundaries.
inline TriangleMesh Dressed(int detail = 1) {
  TriangleMesh trunk = Ball({0, 0, 0}, 0.2, 40 * detail, 40 * detail);
  trunk.positions.row(1) *= 4;
  trunk.positions.row(2).array() += 4;
  return Joined(trunk, Tube({0, 0.25, 4}, 0.5, 0.21, 0.35, 25 * detail, 50 * detail));
}

}  // namespace mpc::testing
