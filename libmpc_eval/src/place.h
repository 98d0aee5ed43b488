// Purpose: where a synthetic performance happens: a room, a street or a park, built around the
// actor's and the camera's paths, and what moves there behind the actor.
// Frames: world, y up, floor at y = 0; cameras look towards -z. Units: metres, seconds.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "mpc/eval/synthetic_scene.h"
#include "mpc/render/lit_scene.h"
#include "place_textures.h"

namespace mpc {

// A body that goes to and fro: at the angle spin_rad * sin about `axis` through `pivot`, shifted by
// `travel` * sin, with sin = sin(omega t + phase).
struct Mover {
  LitMesh body;  // at sin = 0
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d travel = Eigen::Vector3d::Zero();
  double spin_rad = 0;
  double omega = 1;
  double phase = 0;

  LitMesh At(double seconds) const;
};

struct Place {
  std::vector<LitMesh> standing;  // walls, furniture, trees, sky; the first is the floor
  std::vector<size_t> casts;      // those of them that cast shadows
  std::vector<Mover> movers;
  std::vector<LitMesh> occluders;  // between actor and camera, and what the actor sits on
  Lighting lighting;
};

// Throws Error (kUnsupported) when occluders are wanted and there is no room for them.
Place MakePlace(const SceneOptions& options, const StageBounds& stage);

}  // namespace mpc
