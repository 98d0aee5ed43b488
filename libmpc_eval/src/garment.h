// Purpose: loose clothing: the sheet of a skirt or coat, and which parts of the closed body are
// cloth with room to move.
// Frames: as in actor_shape.h. Units: fractions of the height. Symbols: P particles.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "actor_shape.h"
#include "mpc/core/triangle_mesh.h"
#include "mpc/eval/dressed_actor.h"
#include "texture_atlas.h"

namespace mpc {

// A sheet hung around the waist: rings from the waist down, columns around by way of the left side;
// the seam of a skirt is at the back.
struct Sheet {
  int rings = 0;
  int columns = 0;
  bool closed = true;       // the last column meets the first
  TriangleMesh mesh;        // vertex ring * columns + column
  FlatTriangles flat;       // one chart: around, down
  Eigen::MatrixXi parts;    // 3 x P: RigPart of the influences
  Eigen::MatrixXf weights;  // 3 x P

  int num_particles() const { return rings * columns; }
  int At(int ring, int column) const { return ring * columns + column % columns; }
};

// No rings for outfits without a sheet.
Sheet MakeSheet(const ActorShape& shape, Outfit outfit);

// The sheet's particles and links appended to the model; lengths in fractions.
void AddSheet(const Sheet& sheet, ClothModel* model);

// How far a place on the closed body's clothes may move, 0 for skin and what lies tight; `garment`
// tells pieces of clothing apart.
struct Looseness {
  double freedom = 0;
  int garment = 0;
};
Looseness BodyLooseness(const ActorShape& shape, Outfit outfit, const Eigen::Vector3d& x);

}  // namespace mpc
