// Purpose: every choice of the pose stage, with the paper's values as a preset.
// Source: paper, Section 4 and Results; ours: docs/pose.md gives the evidence for each default.
#pragma once

#include "mpc/pose/batch_solver.h"
#include "mpc/pose/frame_solver.h"

namespace mpc {

struct PoseOptions {
  // Windows. Paper: 50 frames, 10 overlap.
  int window_frames = 100;  // >= 2
  int overlap_frames = 20;  // in [1, window_frames / 2]

  // Trajectory subspace, E_d.
  int basis_size = 0;          // K; 0: from the frame rate and cutoff_hz. Paper: 8
  double cutoff_hz = 6;        // ours: motion above it is noise. In (0, 1000]
  double weight_smooth = 0.3;  // w_d. Paper: 50, practically a hard projection
  bool soft_band = true;       // ours: w_d fades in as (k / K)^8 inside the subspace; false: paper
  bool adaptive_band = true;   // ours: and then follows the spectrum of each dof; false: paper
  double lambda_translation = 1;  // per mm (paper)
  double lambda_rotation = 600;   // per rad (paper)
  double lambda_angles = 600;     // per rad (paper)

  // Detections.
  bool repair_detections =
      true;                    // ours: outliers and short gaps mended from the track; false: paper
  bool anisotropic_3d = true;  // bone vectors weighed per ray axis; false: the paper's E_3d
  double weight_3d = 0.1;      // w_3d of the paper's E_3d
  // ours: bone residuals weigh (20 mm / error)^2. The error across the ray is 0: measured per clip
  // from how far the projected 3D lies from the 2D; along the ray it is depth_error_ratio as large.
  double error_3d_mm = 0;
  // ours: 2D residuals weigh (20 mm / error)^2; 0: measured per clip, in [2, 20]. Paper: 20
  double error_2d_mm = 0;
  double depth_error_ratio = 2.2;
  bool pixels_in_mm = true;        // 2D residuals in mm at the person; false: px of a 1920 frame
  bool confidence_weights = true;  // 2D detections weighted by their confidence; false: 1 or 0
  double robust_2d = 100;          // Geman-McClure scale in mm (or px), 0: plain squares (paper)
  double robust_3d = 90;           // of weighted bone residuals, mm, 0: plain squares
  double pck_threshold = 0.4;      // thres_pck of the paper: a frame's 3D is off above it
  bool test_depth_flips = true;    // ours: depth-mirrored limbs are tried over the clip
  // ours: what stands in the picture stands along the ray too, and nothing goes through the floor
  bool hold_standing_feet = true;
  // ours: factor on 3D errors that last, and on the rest prior's variance, once limbs are chosen;
  // 1: paper. In [1, 100]
  double lasting_discount = 2;
  double weight_rest = 1.5;  // ours: rest prior, over a joint's usual spread; 0: paper
  double robust_rest = 1.5;  // Geman-McClure scale of it, in usual spreads, 0: plain squares

  bool fit_proportions = true;  // ours: body proportions estimated once per clip; false: paper

  FrameSolveOptions frame_solver;
  BatchSolveOptions batch_solver;

  int num_threads = 0;  // 0: all cores. Results do not depend on it

  // The paper's method: its weights and none of our changes.
  static PoseOptions Paper();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

}  // namespace mpc
