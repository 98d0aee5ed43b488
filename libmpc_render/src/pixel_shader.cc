#include "pixel_shader.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace mpc {
namespace {

constexpr float kShadowOffsetM = 0.012f;  // along the normal, against a surface's own shadow

Eigen::Array4f Light4(const Eigen::Array3f& bgr) { return {bgr[0], bgr[1], bgr[2], 0}; }

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
    : camera_(camera), list_(list), scene_(scene) {
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

void PixelShader::SetUp(int t) {
  known_ = t;
  const int m = list_.mesh_of[static_cast<size_t>(t)];
  mesh_ = list_.meshes[static_cast<size_t>(m)];
  const Eigen::Vector3i corners = list_.triangles.col(t);
  const Eigen::Vector3i own = corners.array() - list_.first_vertex[static_cast<size_t>(m)];
  Eigen::Matrix3d x;  // corners
  for (int i = 0; i < 3; ++i) x.col(i) = list_.positions.col(corners[i]).cast<double>();
  Eigen::Matrix3d weights;  // . ray
  for (int i = 0; i < 3; ++i) weights.row(i) = x.col((i + 1) % 3).cross(x.col((i + 2) % 3));
  weights *= ray_from_pixel_;  // . (x, y, 1)
  weight_sum_ = weights.colwise().sum();
  if (mesh_->texture) {
    Eigen::Matrix<double, 2, 3> uv;
    for (int i = 0; i < 3; ++i) uv.col(i) = mesh_->uv.col(own[i]).cast<double>();
    uv_ = uv * weights;
    Eigen::Matrix3d homography;
    homography << uv_, weight_sum_.transpose();
    uv_area_ = std::abs(homography.determinant());
  } else if (mesh_->vertex_bgr.cols() > 0) {
    Eigen::Matrix3d bgr;
    for (int i = 0; i < 3; ++i) {
      bgr.col(i) = mesh_->vertex_bgr.col(own[i]).unaryExpr(&LinearFromByte).cast<double>();
    }
    colour_ = bgr * weights;
  } else {
    flat_colour_ = Eigen::Array4f(LinearFromByte(mesh_->bgr[0]), LinearFromByte(mesh_->bgr[1]),
                                  LinearFromByte(mesh_->bgr[2]), 0);
  }
  const Eigen::Vector3d across = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0));
  flat_normal_ = across.normalized().cast<float>();
  if (across.dot(x.col(0)) > 0) flat_normal_ = -flat_normal_;
  flat_surroundings_ = Surroundings(flat_normal_);
  near_lamps_.clear();
  const bool smooth = mesh_->normals.cols() > 0;
  if (smooth) {
    Eigen::Matrix3d normals;
    for (int i = 0; i < 3; ++i) normals.col(i) = mesh_->normals.col(own[i]).cast<double>();
    normal_ = camera_.camera_from_world.rotation * normals * weights;
  }
  const Eigen::Matrix3f in_front =
      x.cast<float>().colwise() + Eigen::Vector3f(kShadowOffsetM * flat_normal_);
  for (const LampView& view : lamps_) {
    if (smooth || !view.Misses(in_front)) near_lamps_.push_back(&view);
  }
}

Eigen::Array4f PixelShader::Colour(const Eigen::Vector3d& at, double w) const {
  if (mesh_->texture) {
    const Eigen::Vector2d uv = w * (uv_ * at);
    // A triangle seen edge-on may be sampled far outside.
    if (!(uv.cwiseAbs().maxCoeff() < 1e6)) return mesh_->texture->Sample(0.5, 0.5, 1);
    return mesh_->texture->Sample(uv.x(), uv.y(), uv_area_ * std::abs(w * w * w));
  }
  if (mesh_->vertex_bgr.cols() == 0) return flat_colour_;
  const Eigen::Vector3f bgr = (w * (colour_ * at)).cast<float>();
  return Light4(bgr.array().max(0.0f).min(1.0f));
}

Eigen::Array4f PixelShader::Surroundings(const Eigen::Vector3f& normal) const {
  const float upwards = 0.5f + 0.5f * normal.dot(up_);
  return upwards * sky_ + (1 - upwards) * ground_;
}

// Unit, on the side that is seen.
Eigen::Vector3f PixelShader::SmoothNormal(const Eigen::Vector3d& at, double w) const {
  const Eigen::Vector3f smooth = (w * (normal_ * at)).cast<float>();
  const float length = smooth.norm();
  if (!(length > 1e-6f && std::isfinite(length))) return flat_normal_;
  return smooth * ((flat_normal_.dot(smooth) < 0 ? -1.0f : 1.0f) / length);
}

Eigen::Array4f PixelShader::ShadeKnown(int column, int row, float z) const {
  const Eigen::Vector3d at(column, row, 1);
  const double w = 1 / weight_sum_.dot(at);
  const Eigen::Array4f colour = Colour(at, w);
  if (mesh_->glows) return colour;
  const bool smooth = mesh_->normals.cols() > 0;
  const Eigen::Vector3f normal = smooth ? SmoothNormal(at, w) : flat_normal_;
  Eigen::Array4f light = smooth ? Surroundings(normal) : flat_surroundings_;
  const Eigen::Vector3f x = z * (ray_from_pixel_ * at).cast<float>();
  if (mesh_->is_floor && scene_.contact != nullptr) {
    light *= 1 - scene_.contact->At(world_x_.dot(x) + eye_in_world_.x(),
                                    world_z_.dot(x) + eye_in_world_.z());
  }
  float facing = normal.dot(to_lamp_);
  if (facing > 0) {
    const Eigen::Vector3f in_front = x + kShadowOffsetM * normal;
    for (const LampView* view : near_lamps_) facing *= view->Visibility(in_front);
    light += facing * lamp_;
  }
  return colour * light;
}

}  // namespace mpc
