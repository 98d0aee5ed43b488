#include "mpc/eval/foot_skate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/core/units.h"

namespace mpc {
namespace {

constexpr std::array kFeet = {JointId::kLeftAnkle, JointId::kRightAnkle, JointId::kLeftToe,
                              JointId::kRightToe};

void CheckArguments(std::span<const JointId> joints, const Eigen::MatrixXd& estimate,
                    const Eigen::MatrixXd& truth, double fps, const Eigen::Vector3d& up) {
  if (estimate.rows() != truth.rows() || estimate.cols() != truth.cols() ||
      estimate.rows() != static_cast<Eigen::Index>(3 * joints.size())) {
    throw Error(
        ErrorCode::kMismatch,
        fmt::format("joint trajectories of {} x {} and {} x {} for {} joints", estimate.rows(),
                    estimate.cols(), truth.rows(), truth.cols(), joints.size()));
  }
  if (!(fps > 0) || !(std::abs(up.norm() - 1) < 1e-6)) {
    throw Error(
        ErrorCode::kInvalidArgument,
        fmt::format("foot skate needs a frame rate above 0 and a unit vector up, not {} and "
                    "({}, {}, {})",
                    fps, up.x(), up.y(), up.z()));
  }
}

// Lowest finite height of one joint's track (3 x F); NaN when it has none.
double LowestHeight(const Eigen::Matrix3Xd& track, const Eigen::Vector3d& up) {
  double lowest = kNan;
  for (const auto& x : track.colwise()) lowest = std::fmin(lowest, x.dot(up));
  return lowest;
}

}  // namespace

FootSkate CompareFootSkate(std::span<const JointId> joints, const Eigen::MatrixXd& estimate,
                           const Eigen::MatrixXd& truth, double fps, const Eigen::Vector3d& up,
                           const ContactOptions& options) {
  CheckArguments(joints, estimate, truth, fps, up);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(truth.cols());
  Eigen::VectorXi count = Eigen::VectorXi::Zero(truth.cols());
  for (size_t j = 0; j < joints.size(); ++j) {
    if (std::find(kFeet.begin(), kFeet.end(), joints[j]) == kFeet.end()) continue;
    const Eigen::Matrix3Xd e = estimate.middleRows<3>(static_cast<Eigen::Index>(3 * j));
    const Eigen::Matrix3Xd t = truth.middleRows<3>(static_cast<Eigen::Index>(3 * j));
    const double ceiling = LowestHeight(t, up) + options.max_height;
    for (Eigen::Index f = 0; f + 1 < t.cols(); ++f) {
      const Eigen::Vector3d step = t.col(f + 1) - t.col(f);
      const bool stands = step.norm() * fps <= options.max_speed && t.col(f).dot(up) <= ceiling &&
                          t.col(f + 1).dot(up) <= ceiling;
      const Eigen::Vector3d slide = (e.col(f + 1) - e.col(f)) - step;
      if (!stands || !slide.allFinite()) continue;
      sum[f] += kMmPerMetre * (slide - slide.dot(up) * up).norm();
      count[f] += 1;
    }
  }
  FootSkate result;
  result.num_contacts = count.sum();
  result.num_frames = static_cast<int>((count.array() > 0).count());
  // 0 / 0 is the NaN that says "no contact".
  result.mean_mm = sum.sum() / result.num_contacts;
  result.per_frame_mm = sum.cwiseQuotient(count.cast<double>());
  return result;
}

}  // namespace mpc
