// Purpose: change an actor's body proportions: skeleton, mesh and rig together.
// Source: ours (DESIGN "Proportions"); the paper assumes the template has the actor's proportions.
#pragma once

#include <array>

#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc {

// Lengths that may be scaled on their own; left and right always alike. Limb bones stretch along
// themselves, the trunk in height (torso) and width (shoulders: chest, hips: pelvis), the head with
// the neck and the feet as a whole.
enum class BodyPart {
  kTorso,
  kShoulders,
  kHips,
  kHead,
  kUpperArm,
  kForearm,
  kThigh,
  kShank,
  kFoot
};
inline constexpr int kNumBodyParts = 9;
const char* BodyPartName(BodyPart part);

struct Proportions {
  double overall = 1;                                                    // scale of everything
  std::array<double, kNumBodyParts> part = {1, 1, 1, 1, 1, 1, 1, 1, 1};  // relative to overall
};

// The skeleton with scaled offsets and joints; hinges, bounds and rest rotations stay.
Skeleton ScaledSkeleton(const Skeleton& skeleton, const Proportions& proportions);

// Character and rig with the proportions applied at bind: every vertex follows its segments' change
// of origin and length. Both stay consistent: skinning the new character at any pose equals
// skinning the new rig's bones. Feet keep their height above the sole: the actor's lowest vertex
// keeps its y. Throws Error: kInvalidArgument for scales outside [0.2, 5], kMismatch for a
// character of another rig.
void ApplyProportions(const Proportions& proportions, Character* character, RigAsset* rig);

// The mesh's extent along y at bind.
double ActorHeight(const Character& character);

// Scales the actor as a whole to a height (m, at bind), by any factor; returns the factor. Throws
// Error (kInvalidArgument) for a height or an actor without one.
double ScaleToHeight(double height_m, Character* character, RigAsset* rig);

}  // namespace mpc
