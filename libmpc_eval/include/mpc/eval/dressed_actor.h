// Purpose: a clothed, textured and rigged person made by the program itself, so that tests, the
// demo and benchmarks need nobody's model.
// Source: ours; proportions of the default skeleton (Winter), surface as a smooth union of rounded
// body parts; loose clothing hangs as it comes to rest in the simulator of mpc/eval/clothing.h.
// Frames: scene frame, y up, standing on y = 0, facing +z, left = +x, T-pose. Units: metres.
// Symbols: V vertices, P particles.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "mpc/core/capsule_set.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc {

enum class Outfit {
  kTight,   // everything close to the body
  kCasual,  // loose shirt and trousers
  kSkirt,   // a wide skirt to the knees
  kCoat,    // a long coat, open in front
};
inline constexpr std::array<Outfit, 4> kAllOutfits = {Outfit::kTight, Outfit::kCasual,
                                                      Outfit::kSkirt, Outfit::kCoat};

// Short lower-case name, such as "skirt".
std::string_view OutfitName(Outfit outfit);

struct DressedActorOptions {
  Outfit outfit = Outfit::kCasual;
  double height_m = 1.75;     // sole to crown, 0.5 to 3
  double girth = 1;           // thickness of trunk and limbs, 0.7 to 1.5
  double build = 0;           // 0 a man's, 1 a woman's
  double leg_length = 1;      // relative to the default skeleton, 0.7 to 1.3; the trunk gives way
  double arm_length = 1;      // 0.7 to 1.3
  double shoulder_width = 1;  // 0.7 to 1.3
  // 0: exactly as above; else lengths vary by 4 %, girth by 12 %, and build, hair, face, colours
  // and patterns are drawn.
  uint64_t seed = 0;

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

// What of the mesh moves on its own, as particles; empty for a mesh that only follows its bones.
struct ClothModel {
  struct Link {
    int a = 0;
    int b = 0;
    double rest_m = 0;
  };
  struct Collider {
    int bone = 0;     // it follows this bone rigidly
    Capsule capsule;  // scene frame, at bind
  };
  std::vector<int> particle;      // V: the vertex's particle, -1: follows its bones alone
  std::vector<double> freedom_m;  // P: how far it may leave the place its bones give it; 0: held
  std::vector<bool> collides;     // P: stays outside of the colliders
  std::vector<Link> stretch;      // edges, all but inextensible
  std::vector<Link> bend;         // across edges, soft
  std::vector<Link> tethers;      // a is held; b never farther from it than rest_m
  std::vector<Collider> colliders;

  int num_particles() const { return static_cast<int>(freedom_m.size()); }
};

struct DressedActor {
  // One mesh: the closed body, and for skirts and coats an open sheet. Texture coordinates, and the
  // texture as a PNG. Vertices on seams of the texture stand there twice, at one position. Bones
  // have the names of the Unity and VRM humanoids.
  RigAsset rig;
  ClothModel cloth;
};

// 6,000 to 12,000 vertices, outward normals, up to four smooth weights per vertex. Same options,
// same bytes. Throws Error (kInvalidArgument) for invalid options. About half a second.
DressedActor MakeDressedActor(const DressedActorOptions& options = {});

}  // namespace mpc
