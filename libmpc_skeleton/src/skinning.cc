#include "mpc/skeleton/skinning.h"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include "mpc/core/error.h"
#include "skinning_kernel.h"

namespace mpc {
namespace {

static_assert(sizeof(DualQuaternion) == 8 * sizeof(float));

void CheckSizes(const Eigen::Matrix3Xf& positions, const Eigen::MatrixXi& segments,
                const Eigen::MatrixXf& weights, const std::vector<DualQuaternion>& motions,
                const Eigen::Matrix3Xf& out) {
  const Eigen::Index num_vertices = positions.cols();
  if (segments.cols() == num_vertices && weights.cols() == num_vertices &&
      segments.rows() == weights.rows() && segments.rows() > 0 && out.cols() == num_vertices &&
      !motions.empty() && (num_vertices == 0 || out.data() != positions.data())) {
    return;
  }
  throw Error(ErrorCode::kInvalidArgument,
              fmt::format("skinning of {} vertices with {}x{} segments, {}x{} weights, {} motions "
                          "into {} other vertices: sizes do not fit or the output is the input",
                          num_vertices, segments.rows(), segments.cols(), weights.rows(),
                          weights.cols(), motions.size(), out.cols()));
}

SkinningArrays Arrays(const Eigen::Matrix3Xf& positions, const Eigen::MatrixXi& segments,
                      const Eigen::MatrixXf& weights, const std::vector<DualQuaternion>& motions,
                      Eigen::Matrix3Xf* out) {
  CheckSizes(positions, segments, weights, motions, *out);
  return {.positions = positions.data(),
          .segments = segments.data(),
          .weights = weights.data(),
          .motions = motions[0].real.data(),
          .out = out->data(),
          .num_vertices = static_cast<int>(positions.cols()),
          .num_influences = static_cast<int>(segments.rows()),
          .num_segments = static_cast<int>(motions.size())};
}

}  // namespace

void SegmentMotions(const KinematicState& bind, const KinematicState& state,
                    std::vector<DualQuaternion>* motions) {
  if (bind.rotations.size() != state.rotations.size()) {
    throw Error(ErrorCode::kMismatch, fmt::format("bind has {} segments, the state {}",
                                                  bind.rotations.size(), state.rotations.size()));
  }
  motions->resize(state.rotations.size());
  for (size_t s = 0; s < state.rotations.size(); ++s) {
    const Eigen::Matrix3d rotation = state.rotations[s] * bind.rotations[s].transpose();
    const Eigen::Vector3d translation = state.origins.col(s) - rotation * bind.origins.col(s);
    const Eigen::Quaterniond real(rotation);
    const Eigen::Quaterniond dual =
        Eigen::Quaterniond(0, translation.x() / 2, translation.y() / 2, translation.z() / 2) * real;
    (*motions)[s].real = Eigen::Vector4d(real.w(), real.x(), real.y(), real.z()).cast<float>();
    (*motions)[s].dual = Eigen::Vector4d(dual.w(), dual.x(), dual.y(), dual.z()).cast<float>();
  }
}

void SkinDualQuaternion(const Eigen::Matrix3Xf& positions, const Eigen::MatrixXi& segments,
                        const Eigen::MatrixXf& weights, const std::vector<DualQuaternion>& motions,
                        Eigen::Matrix3Xf* out) {
  const SkinningArrays arrays = Arrays(positions, segments, weights, motions, out);
  if (HasAvx2Kernel() && arrays.num_segments <= kMaxAvx2Segments) {
    SkinDualQuaternionAvx2(arrays);
  } else {
    SkinDualQuaternionPortable(arrays, 0);
  }
}

void SkinDualQuaternionScalar(const Eigen::Matrix3Xf& positions, const Eigen::MatrixXi& segments,
                              const Eigen::MatrixXf& weights,
                              const std::vector<DualQuaternion>& motions, Eigen::Matrix3Xf* out) {
  SkinDualQuaternionPortable(Arrays(positions, segments, weights, motions, out), 0);
}

void SkinLinearBlend(const Eigen::Matrix3Xf& positions, const Eigen::MatrixXi& segments,
                     const Eigen::MatrixXf& weights, const std::vector<DualQuaternion>& motions,
                     Eigen::Matrix3Xf* out) {
  CheckSizes(positions, segments, weights, motions, *out);
  for (Eigen::Index v = 0; v < positions.cols(); ++v) {
    const Eigen::Vector3f x = positions.col(v);
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (Eigen::Index k = 0; k < segments.rows(); ++k) {
      const DualQuaternion& motion = motions[segments(k, v)];
      const Eigen::Vector3f r = motion.real.tail<3>();
      const Eigen::Vector3f d = motion.dual.tail<3>();
      const Eigen::Vector3f inner = r.cross(x) + motion.real[0] * x + d;
      const Eigen::Vector3f moved =
          x + 2 * (r.cross(inner) + motion.real[0] * d - motion.dual[0] * r);
      sum += weights(k, v) * moved;
    }
    out->col(v) = sum;
  }
}

void SkinCharacter(const Character& character, const KinematicState& state, Eigen::Matrix3Xf* out) {
  thread_local std::vector<DualQuaternion> motions;
  SegmentMotions(character.bind, state, &motions);
  out->resize(3, character.mesh.positions.cols());
  SkinDualQuaternion(character.mesh.positions, character.segments, character.weights, motions, out);
}

}  // namespace mpc
