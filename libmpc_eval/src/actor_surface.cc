#include "actor_surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <opencv2/imgcodecs.hpp>

#include "mpc/core/error.h"
#include "place_textures.h"

namespace mpc {
namespace {

std::shared_ptr<const Texture> Decoded(const RigMesh& mesh) {
  const cv::Mat picture = cv::imdecode(mesh.texture, cv::IMREAD_COLOR);
  if (picture.empty()) {
    throw Error(ErrorCode::kBadFile,
                fmt::format("the texture of \"{}\" is neither PNG nor JPEG", mesh.name));
  }
  return std::make_shared<const Texture>(picture);
}

// Colours of skin and clothes by where a vertex sits on the body at bind.
class OutfitColors {
 public:
  OutfitColors(const Character& character, uint64_t seed) : character_(character) {
    Dice dice(seed * 31 + 5);
    skin_ = Hsv(dice.Between(0.045, 0.075), dice.Between(0.32, 0.5), dice.Between(0.55, 0.92));
    hair_ = Hsv(dice.Between(0.03, 0.1), dice.Between(0.4, 0.7), dice.Between(0.1, 0.42));
    const double hue = dice.Between(0, 1);
    shirt_ = Hsv(hue, dice.Between(0.35, 0.8), dice.Between(0.45, 0.9));
    stripe_ = Hsv(hue + 0.5, dice.Between(0.1, 0.5), dice.Between(0.5, 0.95));
    trousers_ = Hsv(dice.Between(0.55, 0.7), dice.Between(0.1, 0.55), dice.Between(0.2, 0.5));
    shoes_ = Hsv(dice.Between(0, 0.1), 0.4, dice.Between(0.1, 0.35));
    striped_ = dice.Chance(0.5);
    const auto head = Joint(JointId::kHeadTop), neck = Joint(JointId::kNeck);
    neck_height_ = neck.y();
    crown_height_ = head.y();
    head_centre_ = 0.5 * (head + neck);
  }

  cv::Vec3f At(Eigen::Index vertex) const {
    const Eigen::Vector3d x = character_.mesh.positions.col(vertex).cast<double>();
    Eigen::Index heaviest = 0;
    character_.weights.col(vertex).maxCoeff(&heaviest);
    switch (character_.segments(heaviest, vertex)) {
      case kHeadSegment:
      case kNeckSegment:
        return IsHair(x) ? hair_ : skin_;
      case kLeftForearmSegment:
        return IsHand(x, JointId::kLeftElbow, JointId::kLeftWrist) ? skin_ : Shirt(x);
      case kRightForearmSegment:
        return IsHand(x, JointId::kRightElbow, JointId::kRightWrist) ? skin_ : Shirt(x);
      case kPelvisSegment:
      case kLeftThighSegment:
      case kRightThighSegment:
      case kLeftShankSegment:
      case kRightShankSegment:
        return trousers_;
      case kLeftFootSegment:
      case kRightFootSegment:
        return shoes_;
      default:
        return Shirt(x);
    }
  }

 private:
  Eigen::Vector3d Joint(JointId id) const {
    return character_.bind.joints.col(character_.skeleton.FindJointIndex(id));
  }
  // The upper and the back part of the head, which faces +z at bind.
  bool IsHair(const Eigen::Vector3d& x) const {
    const double up = (x.y() - neck_height_) / (crown_height_ - neck_height_);
    const double forward = (x.z() - head_centre_.z()) / (crown_height_ - neck_height_);
    return up > 0.45 && up > 0.55 + 0.55 * forward;
  }
  bool IsHand(const Eigen::Vector3d& x, JointId elbow, JointId wrist) const {
    const Eigen::Vector3d along = Joint(wrist) - Joint(elbow);
    return (x - Joint(elbow)).dot(along) > 0.96 * along.squaredNorm();
  }
  cv::Vec3f Shirt(const Eigen::Vector3d& x) const {
    const double period = 0.07 * crown_height_;
    const double part = x.y() / period - std::floor(x.y() / period);
    return striped_ && part < 0.4 ? stripe_ : shirt_;
  }

  const Character& character_;
  cv::Vec3f skin_, hair_, shirt_, stripe_, trousers_, shoes_;
  bool striped_ = false;
  double neck_height_ = 0, crown_height_ = 0;
  Eigen::Vector3d head_centre_;
};

}  // namespace

ActorSurface::ActorSurface(const RigAsset& rig, const Character& character, uint64_t seed) {
  if (rig.num_vertices() != character.mesh.positions.cols()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("a rig of {} vertices for a character of {}", rig.num_vertices(),
                            character.mesh.positions.cols()));
  }
  weld_ = WeldedVertices(character.mesh.positions);
  triangles_ = welded_ = character.mesh.triangles;
  for (int& v : welded_.reshaped()) v = weld_[static_cast<size_t>(v)];
  const OutfitColors colors(character, seed);
  Eigen::Index first = 0;
  for (const RigMesh& mesh : rig.meshes) {
    LitMesh part;
    part.mesh = mesh.mesh;
    if (!mesh.texture.empty()) {
      part.texture = Decoded(mesh);
      part.uv = mesh.uv;
    } else {
      part.vertex_bgr.resize(3, mesh.mesh.positions.cols());
      for (Eigen::Index v = 0; v < mesh.mesh.positions.cols(); ++v) {
        const cv::Vec3f bgr = colors.At(first + v);
        part.vertex_bgr.col(v) << bgr[0], bgr[1], bgr[2];
      }
    }
    first += mesh.mesh.positions.cols();
    parts_.push_back(std::move(part));
  }
}

std::vector<LitMesh> ActorSurface::At(const Eigen::Matrix3Xf& vertices) const {
  Eigen::Matrix3Xf normals;
  VertexNormals(vertices, welded_, &normals);
  for (Eigen::Index v = 0; v < normals.cols(); ++v) {
    normals.col(v) = normals.col(weld_[static_cast<size_t>(v)]).eval();
  }
  std::vector<LitMesh> parts = parts_;
  Eigen::Index first = 0;
  for (LitMesh& part : parts) {
    const Eigen::Index count = part.mesh.positions.cols();
    part.mesh.positions = vertices.middleCols(first, count);
    part.normals = normals.middleCols(first, count);
    first += count;
  }
  return parts;
}

}  // namespace mpc
