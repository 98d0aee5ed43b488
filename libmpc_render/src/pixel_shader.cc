#include "pixel_shader.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace mpc {
namespace {

constexpr size_t kPrepared = 2048;        // triangles
constexpr float kShadowOffsetM = 0.012f;  // along the normal, against a surface's own shadow

Eigen::Array4f Light4(const Eigen::Array3f& bgr) { return {bgr[0], bgr[1], bgr[2], 0}; }

// A linear function of the picture at pixel `at` and those to the right of it.
LampView::Lanes Ramp(const Eigen::Vector3d& function, const Eigen::Vector3d& at) {
  static_assert(kShadedTogether == 8);
  constexpr std::array<float, kShadedTogether> kSteps = {0, 1, 2, 3, 4, 5, 6, 7};
  const auto first = static_cast<float>(function.dot(at));
  return first + static_cast<float>(function[0]) * Eigen::Map<const LampView::Lanes>(kSteps.data());
}

LampView::Lanes Dot(const LampView::Points& points, const Eigen::Vector3f& with) {
  return with[0] * points[0] + with[1] * points[1] + with[2] * points[2];
}

}  // namespace

DrawList MakeDrawList(const Camera& camera, const std::vector<const LitMesh*>& meshes) {
  DrawList list;
  list.meshes = meshes;
  Eigen::Index num_vertices = 0, num_triangles = 0;
  for (const LitMesh* lit : meshes) {
    list.first_vertex.push_back(static_cast<int>(num_vertices));
    num_vertices += lit->mesh.positions.cols();
    num_triangles += lit->mesh.triangles.cols();
  }
  list.positions.resize(3, num_vertices);
  list.triangles.resize(3, num_triangles);
  list.mesh_of.reserve(static_cast<size_t>(num_triangles));
  Eigen::Index t = 0;
  for (size_t m = 0; m < meshes.size(); ++m) {
    const TriangleMesh& mesh = meshes[m]->mesh;
    list.positions.middleCols(list.first_vertex[m], mesh.positions.cols()) =
        ToCamera(camera.camera_from_world, mesh.positions);
    list.triangles.middleCols(t, mesh.triangles.cols()) =
        mesh.triangles.array() + list.first_vertex[m];
    t += mesh.triangles.cols();
    list.mesh_of.insert(list.mesh_of.end(), static_cast<size_t>(mesh.triangles.cols()),
                        static_cast<int>(m));
  }
  return list;
}

PixelShader::PixelShader(const Camera& camera, const DrawList& list, const LitScene& scene)
    : camera_(camera), list_(list), scene_(scene), prepared_(kPrepared) {
  ray_from_pixel_ << 1 / camera.fx, 0, -camera.cx / camera.fx,  //
      0, 1 / camera.fy, -camera.cy / camera.fy,                 //
      0, 0, 1;
  const CameraFromWorld& pose = camera.camera_from_world;
  const Eigen::Vector3d eye = pose.Inverse().translation;
  eye_in_world_ = eye.cast<float>();
  up_ = pose.rotation.col(1).cast<float>();
  world_x_ = pose.rotation.col(0).cast<float>();
  world_z_ = pose.rotation.col(2).cast<float>();
  to_lamp_ = (pose.rotation * scene.lighting.lamp_in_world.normalized()).cast<float>();
  lamp_ = Light4(scene.lighting.lamp_bgr);
  sky_ = Light4(scene.lighting.sky_bgr);
  ground_ = Light4(scene.lighting.ground_bgr);
  for (const ShadowMap* map : scene.shadows) {
    if (map->lamp.width == 0) continue;
    lamps_.emplace_back(*map, pose);
  }
}

void PixelShader::Prepare(int t, Triangle* triangle) const {
  triangle->id = t;
  const int m = list_.mesh_of[static_cast<size_t>(t)];
  const LitMesh* const mesh = triangle->mesh = list_.meshes[static_cast<size_t>(m)];
  const Eigen::Vector3i corners = list_.triangles.col(t);
  const Eigen::Vector3i own = corners.array() - list_.first_vertex[static_cast<size_t>(m)];
  Eigen::Matrix3d x;  // corners
  for (int i = 0; i < 3; ++i) x.col(i) = list_.positions.col(corners[i]).cast<double>();
  Eigen::Matrix3d weights;  // . ray
  for (int i = 0; i < 3; ++i) weights.row(i) = x.col((i + 1) % 3).cross(x.col((i + 2) % 3));
  weights *= ray_from_pixel_;  // . (x, y, 1)
  triangle->weight_sum = weights.colwise().sum();
  if (mesh->texture) {
    Eigen::Matrix<double, 2, 3> uv;
    for (int i = 0; i < 3; ++i) uv.col(i) = mesh->uv.col(own[i]).cast<double>();
    triangle->uv = uv * weights;
    Eigen::Matrix3d homography;
    homography << triangle->uv, triangle->weight_sum.transpose();
    triangle->uv_area = static_cast<float>(std::abs(homography.determinant()));
  } else if (mesh->vertex_bgr.cols() > 0) {
    Eigen::Matrix3d bgr;
    for (int i = 0; i < 3; ++i) {
      bgr.col(i) = mesh->vertex_bgr.col(own[i]).unaryExpr(&LinearFromByte).cast<double>();
    }
    triangle->colour = bgr * weights;
  } else {
    triangle->flat_colour =
        Eigen::Array4f(LinearFromByte(mesh->bgr[0]), LinearFromByte(mesh->bgr[1]),
                       LinearFromByte(mesh->bgr[2]), 0);
  }
  const Eigen::Vector3d across = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0));
  triangle->flat_normal = across.normalized().cast<float>();
  if (across.dot(x.col(0)) > 0) triangle->flat_normal = -triangle->flat_normal;
  triangle->near_lamps.clear();
  triangle->smooth = mesh->normals.cols() > 0;
  if (triangle->smooth) {
    Eigen::Matrix3d normals;
    for (int i = 0; i < 3; ++i) normals.col(i) = mesh->normals.col(own[i]).cast<double>();
    triangle->normal = camera_.camera_from_world.rotation * normals * weights;
  }
  const Eigen::Matrix3f in_front =
      x.cast<float>().colwise() + Eigen::Vector3f(kShadowOffsetM * triangle->flat_normal);
  for (const LampView& view : lamps_) {
    if (triangle->smooth || !view.Misses(in_front)) triangle->near_lamps.push_back(&view);
  }
}

void PixelShader::Colour(const Eigen::Vector3d& at, int count, const Lanes& inverse,
                         Colours* colours) const {
  if (now_->mesh->texture) {
    // Counted from the whole number below the first pixel's, so that floats are exact enough.
    Eigen::Vector2d first = now_->uv * at / now_->weight_sum.dot(at);
    // A triangle seen edge-on may be sampled far outside.
    if (!(first.cwiseAbs().maxCoeff() < 1e6)) first.setZero();
    const Eigen::Matrix<double, 2, 3> uv =
        now_->uv - first.array().floor().matrix() * now_->weight_sum.transpose();
    const Lanes u = Ramp(uv.row(0), at) * inverse, v = Ramp(uv.row(1), at) * inverse;
    const Lanes area = now_->uv_area * (inverse * inverse * inverse).abs();
    for (int i = 0; i < count; ++i) {
      const bool inside = std::abs(u[i]) < 1e6f && std::abs(v[i]) < 1e6f;
      colours->col(i) = inside ? now_->mesh->texture->Sample(u[i], v[i], area[i])
                               : now_->mesh->texture->Sample(0.5f, 0.5f, 1);
    }
  } else if (now_->mesh->vertex_bgr.cols() > 0) {
    for (int channel = 0; channel < 3; ++channel) {
      colours->row(channel) =
          (Ramp(now_->colour.row(channel), at) * inverse).max(0.0f).min(1.0f).transpose();
    }
    colours->row(3).setZero();
  } else {
    colours->colwise() = now_->flat_colour;
  }
}

LampView::Points PixelShader::SmoothNormals(const Eigen::Vector3d& at, const Lanes& inverse) const {
  LampView::Points normals;
  for (int i = 0; i < 3; ++i) normals[i] = Ramp(now_->normal.row(i), at) * inverse;
  const Lanes squared = normals[0].square() + normals[1].square() + normals[2].square();
  const Lanes facing = Dot(normals, now_->flat_normal);
  const Lanes scale = (facing < 0).select(-1 / squared.sqrt(), 1 / squared.sqrt());
  for (int i = 0; i < 3; ++i) {
    normals[i] =
        (squared > 1e-12f && squared < 1e30f).select(normals[i] * scale, now_->flat_normal[i]);
  }
  return normals;
}

void PixelShader::AddFew(int x, int y, int count, const float* depth, float* sum) const {
  const Eigen::Vector3d at(x, y, 1);
  const Lanes inverse = 1 / Ramp(now_->weight_sum, at);
  Colours colours;
  Colour(at, count, inverse, &colours);
  Eigen::Map<Eigen::Array<float, 4, Eigen::Dynamic>> out(sum, 4, count);
  if (now_->mesh->glows) {
    out += colours.leftCols(count);
    return;
  }
  LampView::Points point, normal;
  point[2] = depth[0];
  for (int i = 1; i < count; ++i) point[2][i] = depth[i];
  for (int i = 0; i < 2; ++i) point[i] = point[2] * Ramp(ray_from_pixel_.row(i), at);
  if (now_->smooth) {
    normal = SmoothNormals(at, inverse);
  } else {
    for (int i = 0; i < 3; ++i) normal[i] = now_->flat_normal[i];
  }
  const Lanes upwards = 0.5f + 0.5f * Dot(normal, up_);
  Lanes around = Lanes::Ones();  // how much of sky and ground
  if (now_->mesh->is_floor && scene_.contact != nullptr) {
    const Lanes world_x = Dot(point, world_x_) + eye_in_world_.x();
    const Lanes world_z = Dot(point, world_z_) + eye_in_world_.z();
    for (int i = 0; i < count; ++i) around[i] -= scene_.contact->At(world_x[i], world_z[i]);
  }
  Lanes facing = Dot(normal, to_lamp_).max(0.0f);
  if (facing.maxCoeff() > 0) {
    for (int i = 0; i < 3; ++i) point[i] += kShadowOffsetM * normal[i];
    for (const LampView* view : now_->near_lamps) view->Shade(point, &facing);
  }
  for (int i = 0; i < count; ++i) {
    const Eigen::Array4f surroundings = around[i] * (ground_ + upwards[i] * (sky_ - ground_));
    out.col(i) += colours.col(i) * (surroundings + facing[i] * lamp_);
  }
}

void PixelShader::Add(int t, int x, int y, int count, const float* depth, float* sum) {
  Triangle& triangle = prepared_[static_cast<size_t>(t) % prepared_.size()];
  if (t != triangle.id) Prepare(t, &triangle);
  now_ = &triangle;
  for (int i = 0; i < count; i += kShadedTogether) {
    AddFew(x + i, y, std::min(count - i, kShadedTogether), depth + i, sum + 4 * i);
  }
}

}  // namespace mpc
