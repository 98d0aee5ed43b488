#include "mesh_parts.h"

#include <cmath>
#include <numbers>
#include <vector>

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr int kSides = 24;

}  // namespace

LitMesh Quad(const Vector3d& corner, const Vector3d& right, const Vector3d& up,
             const Material& material) {
  LitMesh quad;
  quad.texture = material.texture;
  quad.mesh.positions.resize(3, 4);
  quad.mesh.positions << corner.cast<float>(), (corner + right).cast<float>(),
      (corner + right + up).cast<float>(), (corner + up).cast<float>();
  quad.mesh.triangles.resize(3, 2);
  quad.mesh.triangles << 0, 0, 1, 2, 2, 3;
  const double repeat = material.repeat_m;
  const auto u = static_cast<float>(repeat > 0 ? right.norm() / repeat : 1);
  const auto v = static_cast<float>(repeat > 0 ? up.norm() / repeat : 1);
  quad.uv.resize(2, 4);
  quad.uv << 0, u, u, 0, v, v, 0, 0;
  return quad;
}

LitMesh Box(const Vector3d& least, const Vector3d& most, const Material& material) {
  const Vector3d x(most.x() - least.x(), 0, 0), y(0, most.y() - least.y(), 0),
      z(0, 0, most.z() - least.z());
  return Merged({Quad(least + z, x, y, material), Quad(most - y - z, -x, y, material),
                 Quad(least, z, y, material), Quad(most - y, -z, y, material),
                 Quad(least + y + z, x, -z, material), Quad(least, x, z, material)});
}

LitMesh Turned(const Vector3d& foot, const Eigen::Matrix2Xd& radius_and_height,
               const Material& material) {
  const auto rings = radius_and_height.cols();
  LitMesh body;
  body.texture = material.texture;
  body.mesh.positions.resize(3, rings * (kSides + 1));
  body.normals.resize(3, body.mesh.positions.cols());
  body.uv.resize(2, body.mesh.positions.cols());
  body.mesh.triangles.resize(3, 2 * (rings - 1) * kSides);
  const double top = radius_and_height(1, rings - 1) - radius_and_height(1, 0);
  Eigen::Index t = 0;
  for (Eigen::Index r = 0; r < rings; ++r) {
    const Eigen::Vector2d slope = radius_and_height.col(std::min(r + 1, rings - 1)) -
                                  radius_and_height.col(std::max<Eigen::Index>(r - 1, 0));
    for (int i = 0; i <= kSides; ++i) {
      const double angle = 2 * std::numbers::pi * i / kSides;
      const Vector3d out(std::cos(angle), 0, -std::sin(angle));
      const auto v = r * (kSides + 1) + i;
      const double radius = radius_and_height(0, r), height = radius_and_height(1, r);
      body.mesh.positions.col(v) = (foot + radius * out + Vector3d(0, height, 0)).cast<float>();
      body.normals.col(v) =
          (slope.y() * out - Vector3d(0, slope.x(), 0)).normalized().cast<float>();
      const double repeat = material.repeat_m;
      body.uv.col(v) = Eigen::Vector2f(
          static_cast<float>(i) / kSides,
          static_cast<float>(repeat > 0 ? -height / repeat
                                        : (radius_and_height(1, rings - 1) - height) / top));
      if (r + 1 == rings || i == kSides) continue;
      const auto here = static_cast<int>(v), next = static_cast<int>(v + kSides + 1);
      body.mesh.triangles.col(t++) << here, here + 1, next;
      body.mesh.triangles.col(t++) << here + 1, next + 1, next;
    }
  }
  return body;
}

LitMesh Ball(const Vector3d& centre, double radius, const Material& material) {
  constexpr int kRings = 17;
  Eigen::Matrix2Xd profile(2, kRings);
  for (int r = 0; r < kRings; ++r) {
    const double polar = std::numbers::pi * r / (kRings - 1);
    profile.col(r) << radius * std::sin(polar), -radius * std::cos(polar);
  }
  return Turned(centre, profile, material);
}

LitMesh Merged(const std::vector<LitMesh>& meshes) {
  LitMesh all;
  all.texture = meshes.front().texture;
  Eigen::Index num_vertices = 0, num_triangles = 0;
  bool smooth = true;
  for (const LitMesh& part : meshes) {
    num_vertices += part.mesh.positions.cols();
    num_triangles += part.mesh.triangles.cols();
    smooth &= part.normals.cols() > 0;
  }
  all.mesh.positions.resize(3, num_vertices);
  all.uv.resize(2, num_vertices);
  if (smooth) all.normals.resize(3, num_vertices);
  all.mesh.triangles.resize(3, num_triangles);
  Eigen::Index v = 0, t = 0;
  for (const LitMesh& part : meshes) {
    const auto n = part.mesh.positions.cols(), m = part.mesh.triangles.cols();
    all.mesh.positions.middleCols(v, n) = part.mesh.positions;
    all.uv.middleCols(v, n) = part.uv;
    if (smooth) all.normals.middleCols(v, n) = part.normals;
    all.mesh.triangles.middleCols(t, m) = part.mesh.triangles.array() + static_cast<int>(v);
    v += n;
    t += m;
  }
  return all;
}

}  // namespace mpc
