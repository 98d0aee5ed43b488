// Purpose: which point of the silhouette each vertex on the model's outline should lie on.
// Source: paper, Section 5.2: "for each boundary point of the projected surface model, we search for
// its closest point on the image silhouette that shares a similar normal direction". Body parts,
// support and weights are ours: docs/deform.md.
// Frames: vertices in the camera frame; pixel centres at integers. Units: metres, pixels of `camera`.
// Symbols: C correspondences, V vertices.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/contour2d.h"
#include "mpc/deform/body_parts.h"
#include "mpc/render/boundary.h"
#include "mpc/render/model_mask.h"
#include "mpc/render/raster.h"

namespace mpc {

struct CorrespondenceOptions {
  // Pruned: farther apart than this at the vertex's distance from the camera, m, or with normals
  // that differ by more, rad. The paper gives no values; ours.
  double max_distance_m = 0.12;
  double max_angle_rad = 0.7;
  // Pruned: the way to the target is longer than 2 px and makes more than this angle with the
  // normal there, rad. The closest point of an outline lies straight ahead, unless the outline ends
  // there, cut off or hidden. pi / 2: never (paper).
  double max_slant_rad = 1.5707963267948966;
  // Refuse targets that look like another part of the body (BodyParts); false: paper.
  bool match_parts = true;
  // A part of which less than this share of the outline has a target stays as it is; and so does
  // the whole model below the second. In [0, 1], 0: paper.
  double min_part_support = 0.3;
  double min_support = 0.3;
  // Of vertices closer together than this along the outline one is taken, m; 0: all (paper).
  double min_spacing_m = 0;
  // Weigh vertices by the length of outline they stand for: fingers and toes have many vertices per
  // pixel. false: all alike, as in the paper.
  bool weigh_by_length = true;

  // Leave out what lies hidden behind the outline, which takes a depth image.
  bool drop_hidden = true;

  // As the paper's text, which prunes by normals alone: 10 m are no limit.
  static CorrespondenceOptions Paper();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

struct Correspondences {
  std::vector<int> vertices;  // C, increasing up to where AddUnexplained begins
  Eigen::Matrix2Xd targets;   // 2xC, px: points of the silhouette
  Eigen::Matrix2Xd normals;   // 2xC, unit, pointing out of the silhouette there
  Eigen::VectorXd weights;    // C; over the whole outline their mean is 1
  Eigen::VectorXd distances;  // C, of the vertex from its target along the normal, m at its depth
  // |S|, the size of the model's boundary before anything was pruned, by which E_con is divided: or
  // heavy pruning would make the survivors too strong.
  int num_boundary = 0;

  int size() const { return static_cast<int>(vertices.size()); }
};

// Buffers of FindCorrespondences; reuse them over frames, one per thread.
using CorrespondenceScratch = BoundaryBuffers;

// The outline of a silhouette, made once per frame for all iterations. Points within 2 px of the
// picture's border are left out: what the picture cuts off has no outline there. Throws Error
// (kInvalidArgument) for a contour that is not finite or whose parts differ in number.
ContourIndex IndexSilhouette(const Contour2d& contour, const Camera& camera);

// The outline of a posed or deformed mesh, in pixels of the whole picture, as min_spacing_m and
// drop_hidden say. Throws Error (kInvalidArgument) as FindModelBoundary. O(V + T + pixels of the model).
ModelBoundary FindOutline(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                          const SurfaceTopology& topology, const CorrespondenceOptions& options,
                          CorrespondenceScratch* scratch);

// Its correspondences.
Correspondences MatchOutline(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                             const ModelBoundary& outline, const BodyParts& parts,
                             const ContourIndex& silhouette, const CorrespondenceOptions& options);

// Adds the points of the silhouette that the outline does not explain, since none of its vertices that
// face the same way lies within 1.5 cm: cloth that has flown where no vertex finds a target, and what
// lies between vertices far apart. Each goes to the nearest vertex of the outline within 30 cm that
// faces roughly the same way (78 degrees), if its part has targets: one whose silhouette is missing or
// wrong stays as it is. All points of a silhouette would weigh as much as the model's outline. Ours.
void AddUnexplained(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                    const ModelBoundary& outline, const BodyParts& parts,
                    const ContourIndex& silhouette, const CorrespondenceOptions& options,
                    Correspondences* found);

// Scale of a robust loss, m: so many standard deviations of the distances, as their median tells it.
// 0 without correspondences.
double RobustScale(const Correspondences& correspondences, double deviations);

// Both in one: correspondences of a mesh; none when nothing matches. `topology` and `parts` are
// those of the mesh. Throws Error (kInvalidArgument) as FindModelBoundary. Thread-safe for different
// scratch. O(V + T + pixels of the model).
Correspondences FindCorrespondences(const Camera& camera,
                                    const Eigen::Matrix3Xf& positions_in_camera,
                                    const SurfaceTopology& topology, const BodyParts& parts,
                                    const ContourIndex& silhouette,
                                    const CorrespondenceOptions& options,
                                    CorrespondenceScratch* scratch);

}  // namespace mpc
