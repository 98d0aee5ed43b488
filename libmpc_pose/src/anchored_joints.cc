#include "anchored_joints.h"

namespace mpc {
namespace {

constexpr int kReweightings = 4;
constexpr double kFarFactor = 3;
constexpr double kMaxScale = 2;  // beyond it, or its inverse, the detection keeps its own size

}  // namespace

std::vector<BoneObservation> AnchorJoints(const FrameObservation& observation,
                                          const Eigen::Matrix3Xd& joints, int origin,
                                          double typical_m) {
  const size_t count = observation.joint_3d.size();
  const Eigen::Index size = static_cast<Eigen::Index>(count);
  Eigen::Matrix3Xd posed(3, size);
  Eigen::Matrix3Xd placed(3, size);
  Eigen::Matrix3Xd detected(3, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    posed.col(i) = joints.col(observation.joint_3d[i]) - joints.col(origin);
    detected.col(i) = observation.position_3d[i];
  }
  Eigen::VectorXd trust = Eigen::VectorXd::Ones(size);
  for (int round = 0; round < kReweightings; ++round) {
    const Eigen::VectorXd share = trust / trust.sum();
    const Eigen::Vector3d posed_mean = posed * share;
    const Eigen::Vector3d detected_mean = detected * share;
    const Eigen::Matrix3Xd a = posed.colwise() - posed_mean;
    const Eigen::Matrix3Xd b = detected.colwise() - detected_mean;
    // The errors are the detection's: its size is regressed on the pose's, not the other way round.
    const double aa = (a * share.asDiagonal()).cwiseProduct(a).sum();
    const double ab = (a * share.asDiagonal()).cwiseProduct(b).sum();
    const double scale = aa < kMaxScale * ab && ab < kMaxScale * aa ? aa / ab : 1;
    placed = (scale * b).colwise() + posed_mean;
    const Eigen::ArrayXd relative2 = (posed - placed).colwise().squaredNorm().transpose().array() /
                                     (kFarFactor * kFarFactor * typical_m * typical_m);
    trust = (1 + relative2).square().inverse();
  }
  std::vector<BoneObservation> vectors;
  vectors.reserve(count);
  for (Eigen::Index i = 0; i < size; ++i) {
    if (observation.joint_3d[i] == origin) continue;
    vectors.push_back(
        {origin, observation.joint_3d[i], placed.col(i), observation.confidence_3d[i]});
  }
  return vectors;
}

}  // namespace mpc
