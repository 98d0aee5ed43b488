// Purpose: the surface where a function of space is zero, as a triangle mesh.
// Source: surface nets (Gibson 1998): one vertex per cell that the surface crosses, one quad per
// grid edge that it crosses; vertices are then moved onto the surface along the gradient.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <vector>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

// distance(x) is negative inside and grows about like a distance, at most twice as fast. Of several
// bodies the largest is taken, and hollows are filled. `planes` are the increasing x, y
// and z coordinates of the grid's planes; the surface must lie inside with a cell to spare.
// Triangles are counter-clockwise seen from outside (the positive side).
TriangleMesh ExtractSurface(const std::function<double(const Eigen::Vector3d&)>& distance,
                            const std::array<std::vector<double>, 3>& planes);

}  // namespace mpc
