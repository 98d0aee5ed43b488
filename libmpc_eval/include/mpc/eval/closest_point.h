// Purpose: how far points are from a surface: the nearest point on any triangle, by a tree of boxes.
// Source: point against triangle after Ericson 2004, "Real-Time Collision Detection", 5.1.5.
// Frames: any. Units: metres. Symbols: T triangles.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

// Distance of a point from triangle abc, of any shape; exactly 0 at its corners.
double TriangleDistance(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                        const Eigen::Vector3d& b, const Eigen::Vector3d& c);

// Immutable after construction and safe to query from several threads.
class SurfaceTree {
 public:
  // Throws Error (kInvalidArgument) for a mesh without triangles, an index out of range or a
  // position that is not finite. O(T log T).
  SurfaceTree(const Eigen::Matrix3Xf& positions, const Triangles& triangles);

  // Distance to the nearest triangle; for finite points that of TriangleDistance over all of them.
  // `hint`, if given, is a triangle to try first and becomes the nearest one: points in an order
  // that walks over the surface are found faster so. The result does not depend on it.
  double Distance(const Eigen::Vector3d& point, int* hint = nullptr) const;

 private:
  struct Node {
    Eigen::Vector3f low;
    Eigen::Vector3f high;
    int begin = 0;  // of a leaf: its triangles in order_
    int count = 0;  // 0: an inner node
    int right = 0;  // of an inner node: its second child; the first one follows the node
  };

  int Build(int begin, int end);
  double DistanceToTriangle(const Eigen::Vector3d& point, int triangle) const;

  std::vector<Eigen::Vector3f> corners_;  // three per triangle
  std::vector<Eigen::Vector3f> centres_;  // empty once built
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace mpc
