#include "mpc/core/blazepose.h"

#include <algorithm>
#include <array>
#include <utility>

namespace mpc {
namespace {

struct Landmark {
  enum : int {
    kNose = 0,
    kLeftEye = 2,
    kRightEye = 5,
    kLeftEar = 7,
    kRightEar = 8,
    kLeftShoulder = 11,
    kRightShoulder = 12,
    kLeftHip = 23,
    kRightHip = 24,
  };
};

// Joints that are one landmark as it stands.
constexpr std::array<std::pair<JointId, int>, 19> kPlainLandmarks = {{
    {JointId::kLeftEar, Landmark::kLeftEar},
    {JointId::kRightEar, Landmark::kRightEar},
    {JointId::kLeftShoulder, Landmark::kLeftShoulder},
    {JointId::kRightShoulder, Landmark::kRightShoulder},
    {JointId::kLeftElbow, 13},
    {JointId::kRightElbow, 14},
    {JointId::kLeftWrist, 15},
    {JointId::kRightWrist, 16},
    {JointId::kLeftKnee, 25},
    {JointId::kRightKnee, 26},
    {JointId::kLeftAnkle, 27},
    {JointId::kRightAnkle, 28},
    {JointId::kLeftHeel, 29},
    {JointId::kRightHeel, 30},
    {JointId::kLeftToe, 31},
    {JointId::kRightToe, 32},
    {JointId::kNose, Landmark::kNose},
    {JointId::kLeftEye, Landmark::kLeftEye},
    {JointId::kRightEye, Landmark::kRightEye},
}};
constexpr std::array kComputedJoints = {JointId::kHeadTop, JointId::kNeck, JointId::kPelvis,
                                        JointId::kLeftHip, JointId::kRightHip};
constexpr int kNumJoints = static_cast<int>(kComputedJoints.size() + kPlainLandmarks.size());

constexpr double kHipShift = 0.07;      // of the torso, towards the shoulders
constexpr double kNeckFromEars = 0.35;  // of the way from mid-shoulder to mid-ear
constexpr double kHeadTopFromEars = 1.8;

template <int D>
void Positions(const Eigen::Matrix<double, D, kNumBlazePoseLandmarks>& x,
               Eigen::Matrix<double, D, Eigen::Dynamic>* positions) {
  using Vector = Eigen::Matrix<double, D, 1>;
  const Vector shoulders = 0.5 * (x.col(Landmark::kLeftShoulder) + x.col(Landmark::kRightShoulder));
  const Vector hips = 0.5 * (x.col(Landmark::kLeftHip) + x.col(Landmark::kRightHip));
  const Vector ears = 0.5 * (x.col(Landmark::kLeftEar) + x.col(Landmark::kRightEar));
  const Vector hip_shift = kHipShift * (shoulders - hips);
  positions->resize(D, kNumJoints);
  positions->col(0) = shoulders + kHeadTopFromEars * (ears - shoulders);
  positions->col(1) = shoulders + kNeckFromEars * (ears - shoulders);
  positions->col(2) = hips + hip_shift;
  positions->col(3) = x.col(Landmark::kLeftHip) + hip_shift;
  positions->col(4) = x.col(Landmark::kRightHip) + hip_shift;
  Eigen::Index j = kComputedJoints.size();
  for (const auto& [joint, landmark] : kPlainLandmarks) positions->col(j++) = x.col(landmark);
}

}  // namespace

const std::vector<JointId>& BlazePoseJoints() {
  static const std::vector<JointId> joints = [] {
    std::vector<JointId> all(kComputedJoints.begin(), kComputedJoints.end());
    for (const auto& [joint, landmark] : kPlainLandmarks) all.push_back(joint);
    return all;
  }();
  return joints;
}

void JointsFromBlazePose(const Eigen::Matrix<double, 2, kNumBlazePoseLandmarks>& landmarks,
                         Eigen::Matrix2Xd* positions) {
  Positions<2>(landmarks, positions);
}

void JointsFromBlazePose(const Eigen::Matrix<double, 3, kNumBlazePoseLandmarks>& landmarks,
                         Eigen::Matrix3Xd* positions) {
  Positions<3>(landmarks, positions);
}

Eigen::VectorXd JointConfidencesFromBlazePose(
    const Eigen::Vector<double, kNumBlazePoseLandmarks>& confidences) {
  const auto& c = confidences;
  const double hips = std::min(c[Landmark::kLeftHip], c[Landmark::kRightHip]);
  const double head = std::min({c[Landmark::kLeftShoulder], c[Landmark::kRightShoulder],
                                c[Landmark::kLeftEar], c[Landmark::kRightEar]});
  Eigen::VectorXd joints(kNumJoints);
  joints.head<5>() << head, head, hips, c[Landmark::kLeftHip], c[Landmark::kRightHip];
  Eigen::Index j = kComputedJoints.size();
  for (const auto& [joint, landmark] : kPlainLandmarks) joints[j++] = c[landmark];
  return joints;
}

}  // namespace mpc
