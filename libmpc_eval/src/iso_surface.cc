#include "iso_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace mpc {
namespace {

// A rectilinear grid of samples, x fastest.
struct Grid {
  Eigen::Vector3i size;
  const std::array<std::vector<double>, 3>& planes;
  std::vector<double> values;

  int Index(const Eigen::Vector3i& i) const {
    return i.x() + size.x() * (i.y() + size.y() * i.z());
  }
  Eigen::Vector3d Position(const Eigen::Vector3i& i) const {
    return {planes[0][i.x()], planes[1][i.y()], planes[2][i.z()]};
  }
  // The shortest side of cell i.
  double CellSize(const Eigen::Vector3i& i) const {
    return (Position(i + Eigen::Vector3i::Ones()) - Position(i)).minCoeff();
  }
  bool Inside(const Eigen::Vector3i& i) const { return values[Index(i)] < 0; }
};

Eigen::Vector3i Corner(const Eigen::Vector3i& cell, int corner) {
  return cell + Eigen::Vector3i(corner & 1, (corner >> 1) & 1, corner >> 2);
}

// A cell face whose inside corners are diagonal would give an edge with four triangles. Makes one
// more corner of each such face inside, until there is none.
void CloseDiagonalFaces(Grid* grid) {
  bool changed = true;
  while (changed) {
    changed = false;
    for (int z = 0; z + 1 < grid->size.z(); ++z) {
      for (int y = 0; y + 1 < grid->size.y(); ++y) {
        for (int x = 0; x + 1 < grid->size.x(); ++x) {
          for (int axis = 0; axis < 3; ++axis) {
            const Eigen::Vector3i a(x, y, z);
            const Eigen::Vector3i b = a + Eigen::Vector3i::Unit((axis + 1) % 3);
            const Eigen::Vector3i d = a + Eigen::Vector3i::Unit((axis + 2) % 3);
            const Eigen::Vector3i c = b + d - a;
            const bool inside = grid->Inside(a);
            if (grid->Inside(c) != inside || grid->Inside(b) == inside ||
                grid->Inside(d) == inside) {
              continue;
            }
            grid->values[grid->Index(inside ? b : a)] = -0.1 * grid->CellSize(a);
            changed = true;
          }
        }
      }
    }
  }
}

// Numbers the pieces of neighbouring grid points that are all inside or all outside.
std::vector<int> Pieces(const Grid& grid, std::vector<int>* sizes) {
  std::vector<int> piece(grid.values.size(), -1);
  const std::array<int, 3> stride = {1, grid.size.x(), grid.size.x() * grid.size.y()};
  std::vector<int> open;
  for (int start = 0; start < static_cast<int>(piece.size()); ++start) {
    if (piece[start] >= 0) continue;
    const auto number = static_cast<int>(sizes->size());
    sizes->push_back(0);
    piece[start] = number;
    open.assign(1, start);
    while (!open.empty()) {
      const int i = open.back();
      open.pop_back();
      ++sizes->back();
      for (int axis = 0; axis < 3; ++axis) {
        const int at = i / stride[axis] % grid.size[axis];
        for (const int step : {-1, 1}) {
          if (at + step < 0 || at + step >= grid.size[axis]) continue;
          const int next = i + step * stride[axis];
          if (piece[next] >= 0 || (grid.values[next] < 0) != (grid.values[i] < 0)) continue;
          piece[next] = number;
          open.push_back(next);
        }
      }
    }
  }
  return piece;
}

// Fills hollows and drops crumbs: what stays is the largest body. Makes no new diagonal faces.
void KeepOneBody(Grid* grid) {
  std::vector<int> sizes;
  const std::vector<int> piece = Pieces(*grid, &sizes);
  int body = -1;
  for (size_t i = 0; i < piece.size(); ++i) {
    if (grid->values[i] < 0 && (body < 0 || sizes[piece[i]] > sizes[body])) body = piece[i];
  }
  const int outside = piece[0];
  for (size_t i = 0; i < piece.size(); ++i) {
    double& value = grid->values[i];
    if (piece[i] == body || piece[i] == outside) continue;
    value = value < 0 ? -value : std::min(-value, -1e-9);
  }
}

// Mean of the crossings on the cell's twelve edges; false when there are none.
bool CellVertex(const Grid& grid, const Eigen::Vector3i& cell, Eigen::Vector3d* vertex) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (int a = 0; a < 8; ++a) {
    for (int axis = 0; axis < 3; ++axis) {
      const int b = a | (1 << axis);
      if (a == b) continue;
      const double value_a = grid.values[grid.Index(Corner(cell, a))];
      const double value_b = grid.values[grid.Index(Corner(cell, b))];
      if ((value_a < 0) == (value_b < 0)) continue;
      const Eigen::Vector3d from = grid.Position(Corner(cell, a));
      const Eigen::Vector3d to = grid.Position(Corner(cell, b));
      sum += from + value_a / (value_a - value_b) * (to - from);
      ++count;
    }
  }
  if (count == 0) return false;
  *vertex = sum / count;
  return true;
}

// Newton's method along the gradient.
Eigen::Vector3d OntoSurface(const std::function<double(const Eigen::Vector3d&)>& distance,
                            Eigen::Vector3d x, double cell) {
  const double step = 1e-3 * cell;
  for (int iteration = 0; iteration < 3; ++iteration) {
    const double here = distance(x);
    if (std::abs(here) < step) break;
    Eigen::Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      gradient[axis] = (distance(x + step * Eigen::Vector3d::Unit(axis)) - here) / step;
    }
    const double slope = gradient.squaredNorm();
    if (slope < 0.05) break;
    Eigen::Vector3d move = -here / slope * gradient;
    if (move.norm() > 0.25 * cell) move *= 0.25 * cell / move.norm();
    x += move;
  }
  return x;
}

}  // namespace

TriangleMesh ExtractSurface(const std::function<double(const Eigen::Vector3d&)>& distance,
                            const std::array<std::vector<double>, 3>& planes) {
  Grid grid{{0, 0, 0}, planes, {}};
  for (int axis = 0; axis < 3; ++axis) grid.size[axis] = static_cast<int>(planes[axis].size());
  grid.values.resize(static_cast<size_t>(grid.size.prod()));
  const auto for_each = [](const Eigen::Vector3i& begin, const Eigen::Vector3i& end, auto&& visit) {
    for (int z = begin.z(); z < end.z(); ++z) {
      for (int y = begin.y(); y < end.y(); ++y) {
        for (int x = begin.x(); x < end.x(); ++x) visit(Eigen::Vector3i(x, y, z));
      }
    }
  };
  const Eigen::Vector3i zero = Eigen::Vector3i::Zero();
  const Eigen::Vector3i one = Eigen::Vector3i::Ones();
  // Where the surface is far away it need not be asked at every point of a row.
  double known_x = 0, known = 0;
  for_each(zero, grid.size, [&](const Eigen::Vector3i& i) {
    const double x = planes[0][i.x()];
    if (i.x() == 0 || x - known_x > 0.5 * std::abs(known)) {
      known = distance(grid.Position(i));
      known_x = x;
    }
    grid.values[grid.Index(i)] = known;
  });
  CloseDiagonalFaces(&grid);
  KeepOneBody(&grid);

  std::vector<int> vertex_of_cell(grid.values.size(), -1);
  std::vector<Eigen::Vector3d> vertices;
  for_each(zero, grid.size - one, [&](const Eigen::Vector3i& i) {
    Eigen::Vector3d vertex;
    if (!CellVertex(grid, i, &vertex)) return;
    vertex_of_cell[grid.Index(i)] = static_cast<int>(vertices.size());
    vertices.push_back(OntoSurface(distance, vertex, grid.CellSize(i)));
  });

  std::vector<Eigen::Vector3i> triangles;
  for_each(one, grid.size - one, [&](const Eigen::Vector3i& i) {
    for (int axis = 0; axis < 3; ++axis) {
      const bool inside = grid.Inside(i);
      if (inside == grid.Inside(i + Eigen::Vector3i::Unit(axis))) continue;
      // The four cells around the edge from i along the axis, counter-clockwise about it.
      const Eigen::Vector3i u = Eigen::Vector3i::Unit((axis + 1) % 3);
      const Eigen::Vector3i v = Eigen::Vector3i::Unit((axis + 2) % 3);
      int quad[4] = {vertex_of_cell[grid.Index(i - u - v)], vertex_of_cell[grid.Index(i - v)],
                     vertex_of_cell[grid.Index(i)], vertex_of_cell[grid.Index(i - u)]};
      if (!inside) std::swap(quad[1], quad[3]);
      // The shorter diagonal.
      const double d02 = (vertices[quad[0]] - vertices[quad[2]]).squaredNorm();
      const double d13 = (vertices[quad[1]] - vertices[quad[3]]).squaredNorm();
      const int first = d02 <= d13 ? 0 : 1;
      triangles.emplace_back(quad[first], quad[first + 1], quad[first + 2]);
      triangles.emplace_back(quad[first + 2], quad[(first + 3) % 4], quad[first]);
    }
  });

  TriangleMesh mesh;
  mesh.positions.resize(3, static_cast<Eigen::Index>(vertices.size()));
  for (size_t v = 0; v < vertices.size(); ++v) {
    mesh.positions.col(static_cast<Eigen::Index>(v)) = vertices[v].cast<float>();
  }
  mesh.triangles.resize(3, static_cast<Eigen::Index>(triangles.size()));
  for (size_t t = 0; t < triangles.size(); ++t) {
    mesh.triangles.col(static_cast<Eigen::Index>(t)) = triangles[t];
  }
  return mesh;
}

}  // namespace mpc
