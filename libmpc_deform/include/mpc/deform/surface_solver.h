// Purpose: the best warp field for given correspondences, min E_surf over D.
// Source: paper, Section 5.3, Eq. 16: E_surf = E_con + w_arap E_arap; depth prior and solver are
// ours: docs/deform.md, "The fast solver".
// Units: costs in mm^2 = px^2, as the energies are weighed. Symbols: M nodes.
#pragma once

#include <Eigen/Core>

#include "mpc/core/camera.h"
#include "mpc/deform/arap_energy.h"
#include "mpc/deform/correspondences.h"
#include "mpc/deform/deformation_graph.h"
#include "mpc/deform/drift_energy.h"
#include "mpc/deform/surface_contour_energy.h"

namespace mpc {

struct SurfaceWeights {
  double arap = 0.6;         // w_arap, px^2/mm^2; paper
  double depth_drift = 2;    // w_ray, px^2/mm^2; ours, 0: paper
  double side_drift = 0.03;  // w_side, px^2/mm^2; ours, 0: paper
};

// E_surf of one frame.
struct SurfaceProblem {
  SurfaceContourEnergy contour;
  ArapEnergy arap;
  DriftEnergy drift;
  Eigen::Matrix3Xd nodes;  // g^, 3xM
  int num_nodes;

  // posed: v^, 3xV in the camera frame. start: the field at the iteration's start, M nodes. Throws
  // Error (kInvalidArgument) for sizes that do not fit.
  SurfaceProblem(const Camera& camera, const DeformationGraph& graph, const Eigen::Matrix3Xf& posed,
                 const Correspondences& correspondences, const SurfaceWeights& weights,
                 const WarpField& start);

  // Infinite outside the energies' domain.
  double Cost(const WarpField& at) const;
};

struct SurfaceSolve {
  bool failed = false;  // the start lies outside the energies' domain; the field is as it was
  double initial_cost = 0;
  double final_cost = 0;
  int steps = 0;
};

// Both improve `field` (of num_nodes nodes), never making it worse, and stop when a step lowers the
// cost by less than relative_tolerance. SolveSurface: Gauss-Newton steps by conjugate gradients in
// float with the inverse 6x6 blocks as preconditioner; costs and gradients in double.
// SolveSurfaceCeres: a sparse Cholesky factorisation, the oracle, many times slower. Both are
// single-threaded and give the same bits for the same input.
SurfaceSolve SolveSurface(const SurfaceProblem& problem, double relative_tolerance, int max_steps,
                          WarpField* field);
SurfaceSolve SolveSurfaceCeres(const SurfaceProblem& problem, double relative_tolerance,
                               int max_steps, WarpField* field);

}  // namespace mpc
