// Purpose: the actor as the solvers see it: the capture skeleton fitted into a rig's bind pose,
// and the mesh bound to its segments.
// Frames: actor frame = the rig's scene frame, y up. Units: metres.
// Symbols: S segments, V vertices, K influences per vertex.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "mpc/core/triangle_mesh.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/rig_asset.h"
#include "mpc/skeleton/rig_map.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

struct Character {
  Skeleton skeleton;
  Eigen::VectorXd bind_pose;      // N: ForwardKinematics(bind_pose) puts the segments on the rig
  KinematicState bind;            // the same, computed
  TriangleMesh mesh;              // all skinned primitives, in the actor frame at bind
  Eigen::Matrix2Xf uv;            // 2xV or empty
  Eigen::MatrixXi segments;       // KxV, indices of segments
  Eigen::MatrixXf weights;        // KxV, non-negative, each column sums to one
  std::vector<int> bone_segment;  // per rig bone: the segment it follows rigidly
};

// Fits the default skeleton into the rig: joint positions from the mapped bones, hinge axes from
// the anatomical frame of each limb at bind, toe tips, heels, the head top and the face from the
// mesh, or by average proportions where it does not show them. At bind the head is taken to be
// straight and the feet to stand flat; an elbow or knee bent by more than 10 degrees defines its
// hinge. The skeleton's forward kinematics at bind_pose reproduces the bones' positions exactly;
// bind angles may lie outside the bounds. Weights are merged per segment, normalised, the heaviest
// first; a vertex without weights follows the nearest bone.
// Throws Error: kUnsupported for a rig whose parts coincide (zero-length limbs), whose left and
// right cannot be told apart, or without a required part; kMismatch for a map of another rig;
// kBadFile for a rig that does not validate.
Character BuildCharacter(const RigAsset& rig, const RigMap& map);

}  // namespace mpc
