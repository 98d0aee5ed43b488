// Purpose: the actor as lit meshes: its textures, or plausible colours where it has none.
// Symbols: V vertices.
#pragma once

#include <cstdint>
#include <vector>

#include "mpc/render/lit_scene.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc {

// Immutable; one lit mesh per mesh of the rig.
class ActorSurface {
 public:
  // Throws Error: kInvalidArgument for a rig whose vertices are not the character's, kBadFile for a
  // texture that is no picture.
  ActorSurface(const RigAsset& rig, const Character& character, uint64_t seed);

  // The surface with its vertices (3xV of the character) there, normals smooth across UV seams.
  std::vector<LitMesh> At(const Eigen::Matrix3Xf& vertices) const;
  const Triangles& triangles() const { return triangles_; }  // the character's

 private:
  std::vector<LitMesh> parts_;  // at bind
  std::vector<int> weld_;       // V: the first vertex at the same place
  Triangles triangles_;
  Triangles welded_;  // the same between welded vertices
};

}  // namespace mpc
