#include "mpc/pose/focal_search.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/pose/pose_estimator.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

constexpr int kMaxFrames = 40;
constexpr double kRestShare = 0.4;  // of the rest prior's weight, as squares
constexpr double kUsualSigma = 0.3;
// Tried: differences from the prior in log(focal), in its standard deviations. A parabola goes
// through the results.
constexpr std::array kSteps = {-2.0, -1.0, 0.0, 1.0, 2.0};
// A detector's errors last for a second and are shared by neighbouring joints: a clip's residuals
// count as this many independent ones. A joint has two in 2D and three in 3D.
constexpr double kIndependentResiduals2d = 20;
constexpr double kIndependentResiduals3d = 30;
constexpr double kMaxErrors3d = 3;    // a 3D residual beyond counts as this many usual errors
constexpr double kUsualErrorMm = 32;  // of 3D detections, across the ray

template <typename Detections>
Detections Thinned(const Detections& detections, int step) {
  Detections thinned = detections;
  thinned.frames.clear();
  for (size_t f = 0; f < detections.frames.size(); f += static_cast<size_t>(step)) {
    thinned.frames.push_back(detections.frames[f]);
  }
  return thinned;
}

// Mean square of the 2D residuals, px, each weighted with the detection's confidence.
double MeanSquare2d(const PoseTrack& track) {
  double sum = 0, weight = 0;
  for (const FrameReport& frame : track.frames) {
    if (frame.state == TrackState::kInterpolated) continue;
    for (const JointReport& joint : frame.joints) {
      if (joint.state != TrackState::kTracked) continue;
      sum += joint.confidence * joint.residual_px * joint.residual_px;
      weight += joint.confidence;
    }
  }
  return weight > 0 ? sum / weight : 1;
}

// Mean square of the 3D residuals, in usual errors: joints against detections, in the detections'
// axes, without their common offset. A wrong focal length is paid for here: limbs are put to wrong
// depths to be where the picture shows them.
double MeanSquare3d(const Skeleton& skeleton, const PoseTrack& track,
                    const Detections3d& detections, double depth_error_ratio) {
  const Eigen::MatrixXd joints = JointTrajectories(skeleton, track.poses);
  const auto num_joints = static_cast<Eigen::Index>(skeleton.joints.size());
  Eigen::Matrix3Xd captured(3, num_joints), detected(3, num_joints);
  Eigen::VectorXd confidence(num_joints);
  double sum = 0, weight = 0;
  for (size_t f = 0; f < detections.frames.size(); ++f) {
    const Detections3d::Frame& frame = detections.frames[f];
    for (Eigen::Index j = 0; j < num_joints; ++j) {
      const int column = FindColumn(detections.joints, skeleton.joints[static_cast<size_t>(j)].id);
      captured.col(j) = joints.block<3, 1>(3 * j, static_cast<Eigen::Index>(f));
      detected.col(j).setZero();
      if (column >= 0) detected.col(j) = frame.positions.col(column);
      confidence[j] = column >= 0 ? frame.confidence[column] : 0;
    }
    if (!(confidence.sum() > 0)) continue;
    const Eigen::VectorXd share = confidence / confidence.sum();
    if (detections.ray_aligned) {
      const Eigen::Vector3d middle = captured * share;
      const Eigen::Matrix3d ray_from_camera =
          Eigen::Quaterniond::FromTwoVectors(middle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      captured = (ray_from_camera * captured).eval();
    }
    Eigen::Matrix3Xd errors = (captured - detected) * (1000 / kUsualErrorMm);
    errors.colwise() -= (errors * share).eval();
    errors.row(2) /= depth_error_ratio;
    const Eigen::VectorXd squares =
        errors.colwise().squaredNorm().cwiseMin(kMaxErrors3d * kMaxErrors3d);
    sum += confidence.dot(squares);
    weight += confidence.sum();
  }
  return weight > 0 ? sum / weight : 1;
}

}  // namespace

FocalPrior FocalPrior::Usual(int width, int height) {
  return {.focal_px = Camera::FromFov(width, height, kUsualFovRad).fx,
          .relative_sigma = kUsualSigma};
}

FocalEstimate EstimateFocal(const Skeleton& skeleton, int width, int height,
                            const Detections2d& detections2d, const Detections3d* detections3d,
                            double fps, const PoseOptions& options, const FocalPrior& prior,
                            const ProgressCallback& progress) {
  if (!(prior.focal_px > 0 && prior.relative_sigma > 0 && prior.relative_sigma < 1)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("focal length of {} px with a spread of {}, expected above 0, and the "
                            "spread below 1",
                            prior.focal_px, prior.relative_sigma));
  }
  const int num_frames = static_cast<int>(detections2d.frames.size());
  const int step = std::max(1, (num_frames + kMaxFrames - 1) / kMaxFrames);
  const Detections2d thin2d = Thinned(detections2d, step);
  Detections3d thin3d;
  if (detections3d != nullptr) thin3d = Thinned(*detections3d, step);
  PoseOptions quick = options;
  quick.fit_proportions = false;
  quick.test_depth_flips = false;
  quick.hold_standing_feet = false;  // they stand where the focal length puts them
  quick.lasting_discount = 1;
  // Limbs are not chosen here: a prior that lets go of them would go with mirrored ones.
  quick.weight_rest *= kRestShare;
  quick.robust_rest = 0;

  Camera camera = Camera::FromFov(width, height, kUsualFovRad);
  Eigen::MatrixX3d rows(kSteps.size(), 3);
  Eigen::VectorXd costs(kSteps.size());
  int num_tried = 0;
  for (const double sigmas : kSteps) {
    camera.fx = camera.fy = prior.focal_px * std::exp(sigmas * prior.relative_sigma);
    const PoseTrack track = EstimatePoses(
        skeleton, camera, thin2d, detections3d != nullptr ? &thin3d : nullptr, fps / step, quick);
    // Residuals of unknown spread: their likelihood is a power of their mean square.
    double cost = kIndependentResiduals2d / 2 * std::log(MeanSquare2d(track));
    if (detections3d != nullptr) {
      cost += kIndependentResiduals3d / 2 *
              std::log(MeanSquare3d(skeleton, track, thin3d, options.depth_error_ratio));
    }
    costs[num_tried] = cost;
    rows.row(num_tried++) << sigmas * sigmas, sigmas, 1;
    if (progress && !progress({"focal", num_tried, static_cast<int>(kSteps.size())})) break;
  }
  Eigen::Vector3d parabola = Eigen::Vector3d::Zero();
  if (num_tried >= 3) {
    parabola = rows.topRows(num_tried).colPivHouseholderQr().solve(costs.head(num_tried));
  }
  const double curvature = std::max(0.0, 2 * parabola[0]) + 1;
  const double best = std::clamp(-parabola[1] / curvature, kSteps.front(), kSteps.back());
  return {.focal_px = prior.focal_px * std::exp(best * prior.relative_sigma),
          .relative_sigma = prior.relative_sigma / std::sqrt(curvature)};
}

}  // namespace mpc
