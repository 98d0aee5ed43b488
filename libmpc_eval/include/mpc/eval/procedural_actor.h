// Purpose: a simple rigged person made by the program itself, so that tests and the demo need
// nobody's model.
// Source: ours; proportions of the default skeleton (Winter), surface as a smooth union of rounded
// body parts.
// Frames: scene frame, y up, standing on y = 0, facing +z, left = +x, T-pose. Units: metres.
#pragma once

#include <cstdint>

#include "mpc/skeleton/rig_asset.h"

namespace mpc {

struct ProceduralActorOptions {
  double height_m = 1.75;     // sole to crown, 0.5 to 3
  double girth = 1;           // thickness of trunk and limbs, 0.7 to 1.5
  double leg_length = 1;      // relative to the default skeleton, 0.7 to 1.3; the trunk gives way
  double arm_length = 1;      // 0.7 to 1.3
  double shoulder_width = 1;  // 0.7 to 1.3
  uint64_t seed = 0;          // 0: exactly as above; else each of the above times 1 +- 4 % or so

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

// One watertight mesh of about 5,000 vertices, outward normals, uv as seen from the front (u across
// the arms' span, v from crown to sole), up to four smooth weights per vertex; bones with the names
// of the Unity and VRM humanoids (hips, spine, chest, neck, head, leftUpperArm, ...). Same options,
// same bytes. About half a second.
RigAsset ProceduralActor(const ProceduralActorOptions& options = {});

}  // namespace mpc
