// Purpose: the bodies that places are built of.
// Frames: world, y up. Units: metres; texture coordinates in repeats of the texture.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "mpc/render/lit_scene.h"

namespace mpc {

using TexturePtr = std::shared_ptr<const Texture>;

// A texture and how many metres one repeat of it covers; 0: once over every face.
struct Material {
  TexturePtr texture;
  double repeat_m = 0;
};

// corner + s * right + t * up, s and t 0 to 1; seen from both sides. Texture upright along `up`.
LitMesh Quad(const Eigen::Vector3d& corner, const Eigen::Vector3d& right, const Eigen::Vector3d& up,
             const Material& material);
// Between two corners.
LitMesh Box(const Eigen::Vector3d& least, const Eigen::Vector3d& most, const Material& material);
// A body of revolution about the vertical through `foot`: radii at heights, smooth.
LitMesh Turned(const Eigen::Vector3d& foot, const Eigen::Matrix2Xd& radius_and_height,
               const Material& material);
LitMesh Ball(const Eigen::Vector3d& centre, double radius, const Material& material);
// Several meshes of one texture as one.
LitMesh Merged(const std::vector<LitMesh>& meshes);

}  // namespace mpc
