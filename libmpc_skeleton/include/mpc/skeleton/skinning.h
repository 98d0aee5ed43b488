// Purpose: move a mesh with the skeleton: dual-quaternion skinning, and linear-blend as its twin.
// Source: Kavan et al. 2007, "Skinning with dual quaternions" (paper, Section 4).
// Units: metres. Symbols: S segments, V vertices, K influences.
// Contract: positions 3xV in; out is sized by the caller (3xV) and must not alias the input;
// segments and weights KxV, every column of weights sums to one. Throws Error (kInvalidArgument)
// for sizes that do not fit; segment indices must be valid, they are not checked per call. No
// allocation after the first call with the same sizes. Thread-safe for different outputs.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {

// Rigid motion of one segment from the bind pose: body = rotation * x_at_bind + translation, as a
// unit dual quaternion in float. real and dual are (w, x, y, z).
struct DualQuaternion {
  Eigen::Vector4f real = {1, 0, 0, 0};
  Eigen::Vector4f dual = {0, 0, 0, 0};
};

// Motions of all segments between two states: S entries, sized by the function. Throws Error
// (kMismatch) for states of different skeletons.
void SegmentMotions(const KinematicState& bind, const KinematicState& state,
                    std::vector<DualQuaternion>* motions);

// Blends dual quaternions per vertex, antipodality resolved against the vertex's first influence
// (which should weigh something; a blend that cancels out stays finite, but means nothing).
// The kernel picks AVX2+FMA at run time where the machine has it; the Scalar twin is the reference.
void SkinDualQuaternion(const Eigen::Matrix3Xf& positions, const Eigen::MatrixXi& segments,
                        const Eigen::MatrixXf& weights, const std::vector<DualQuaternion>& motions,
                        Eigen::Matrix3Xf* out);
void SkinDualQuaternionScalar(const Eigen::Matrix3Xf& positions, const Eigen::MatrixXi& segments,
                              const Eigen::MatrixXf& weights,
                              const std::vector<DualQuaternion>& motions, Eigen::Matrix3Xf* out);

// Linear-blend skinning with the same arguments.
void SkinLinearBlend(const Eigen::Matrix3Xf& positions, const Eigen::MatrixXi& segments,
                     const Eigen::MatrixXf& weights, const std::vector<DualQuaternion>& motions,
                     Eigen::Matrix3Xf* out);

// The character's mesh at a pose: 3xV, sized by the function.
void SkinCharacter(const Character& character, const KinematicState& state, Eigen::Matrix3Xf* out);

}  // namespace mpc
