// Purpose: a person in a skirt before a camera, posed and as the silhouette shows it: the known
// deformation that the surface has to find again.
// Frames: camera frame. Units: metres.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "deform/surface_meshes.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/render/raster.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc::testing {

struct DressedPerson {
  Character character;     // the synthetic actor with a skirt that hangs on its hips
  Camera camera;           // 3.5 m away, the person upright in the picture
  Eigen::Matrix3Xf posed;  // at bind, in the camera frame
  Eigen::Matrix3Xf truth;  // the skirt's hem blown to the side, the trunk bulging
  int first_of_skirt = 0;
};

inline DressedPerson MakeDressedPerson(double blown_m = 0.05, double bulge_m = 0.02) {
  DressedPerson person;
  const RigAsset rig = MakeDressedActor({.outfit = Outfit::kTight}).rig;
  Character& character = person.character = BuildCharacter(rig, MapRigByNames(rig));
  const int body = person.first_of_skirt = static_cast<int>(character.mesh.positions.cols());
  // Tubes run along increasing y, the actor's up: the hem is at its start.
  const Eigen::Vector3d hips(0, 0.80, 0);
  character.mesh = Joined(character.mesh, Tube(hips, 0.42, 0.30, 0.19, 40, 72));
  const Eigen::Index skirt = character.mesh.positions.cols() - body;
  character.segments.conservativeResize(Eigen::NoChange, body + skirt);
  character.weights.conservativeResize(Eigen::NoChange, body + skirt);
  character.segments.rightCols(skirt).setZero();  // the pelvis
  character.weights.rightCols(skirt).setZero();
  character.weights.row(0).tail(skirt).setOnes();
  character.uv.resize(2, 0);

  person.camera = Camera::FromFov(1080, 1920, 0.8);
  const auto to_camera = [](const Eigen::Matrix3Xf& x) {
    Eigen::Matrix3Xf in_camera = Eigen::Vector3f(1, -1, -1).asDiagonal() * x;
    in_camera.colwise() += Eigen::Vector3f(0, 0.9f, 3.5f);
    return in_camera;
  };
  person.posed = to_camera(character.mesh.positions);
  Eigen::Matrix3Xf truth = character.mesh.positions;
  for (int v = 0; v < truth.cols(); ++v) {
    const float height = truth(1, v);
    if (v >= body) {
      const float down = (1.01f - height) / 0.42f;
      truth(0, v) += static_cast<float>(blown_m) * down * down;
    } else if (std::abs(truth(0, v)) < 0.2f) {
      // A smooth bump around the belly, outwards.
      const float bump = std::exp(-std::pow((height - 1.15f) / 0.1f, 2.0f));
      const Eigen::Vector2f out = Eigen::Vector2f(truth(0, v), truth(2, v)).stableNormalized();
      truth(0, v) += static_cast<float>(bulge_m) * bump * out.x();
      truth(2, v) += static_cast<float>(bulge_m) * bump * out.y();
    }
  }
  person.truth = to_camera(truth);
  return person;
}

inline cv::Mat MaskOf(const DressedPerson& person, const Eigen::Matrix3Xf& positions) {
  return MeshMask(person.camera, positions, person.character.mesh.triangles);
}

}  // namespace mpc::testing
