// Purpose: the surface where a function of space is zero, as a triangle mesh.
// Source: surface nets (Gibson 1998): one vertex per cell that the surface crosses, one quad per
// grid edge that it crosses; vertices are then moved onto the surface along the gradient.
#pragma once

#include <Eigen/Core>
#include <functional>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

// distance(x) is negative inside and grows about like a distance. The box must contain the surface
// with a cell to spare. Triangles are counter-clockwise seen from outside (the positive side).
TriangleMesh ExtractSurface(const std::function<double(const Eigen::Vector3d&)>& distance,
                            const Eigen::Vector3d& box_min, const Eigen::Vector3d& box_max,
                            double cell);

}  // namespace mpc
