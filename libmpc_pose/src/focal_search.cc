#include "mpc/pose/focal_search.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "mpc/pose/pose_estimator.h"

namespace mpc {
namespace {

constexpr int kMaxFrames = 40;
constexpr double kPriorSigma = 0.3;  // of log(focal): 46 to 77 degrees around 60
// Tried: differences in log(focal) from the usual one. A parabola goes through the results.
constexpr std::array kSteps = {-0.7, -0.35, 0.0, 0.35, 0.7};
// A detector's errors last for a second and are shared by neighbouring joints: a clip's residuals
// count as this many independent ones.
constexpr double kIndependentResiduals = 20;

template <typename Detections>
Detections Thinned(const Detections& detections, int step) {
  Detections thinned = detections;
  thinned.frames.clear();
  for (size_t f = 0; f < detections.frames.size(); f += static_cast<size_t>(step)) {
    thinned.frames.push_back(detections.frames[f]);
  }
  return thinned;
}

// Mean square of the 2D residuals, each weighted with the detection's confidence.
double MeanSquarePx(const PoseTrack& track) {
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

}  // namespace

FocalEstimate EstimateFocal(const Skeleton& skeleton, int width, int height,
                            const Detections2d& detections2d, const Detections3d* detections3d,
                            double fps, const PoseOptions& options,
                            const ProgressCallback& progress) {
  const int num_frames = static_cast<int>(detections2d.frames.size());
  const int step = std::max(1, (num_frames + kMaxFrames - 1) / kMaxFrames);
  const Detections2d thin2d = Thinned(detections2d, step);
  Detections3d thin3d;
  if (detections3d != nullptr) thin3d = Thinned(*detections3d, step);
  PoseOptions quick = options;
  quick.fit_proportions = false;
  quick.test_depth_flips = false;

  const Camera usual = Camera::FromFov(width, height, kUsualFovRad);
  Eigen::MatrixX3d rows(kSteps.size(), 3);
  Eigen::VectorXd costs(kSteps.size());
  int num_tried = 0;
  for (const double log_scale : kSteps) {
    Camera camera = usual;
    camera.fx = camera.fy = usual.fx * std::exp(log_scale);
    const PoseTrack track = EstimatePoses(
        skeleton, camera, thin2d, detections3d != nullptr ? &thin3d : nullptr, fps / step, quick);
    // Residuals of unknown spread: their likelihood is a power of their mean square.
    costs[num_tried] = kIndependentResiduals / 2 * std::log(MeanSquarePx(track));
    rows.row(num_tried++) << log_scale * log_scale, log_scale, 1;
    if (progress && !progress({"focal", num_tried, static_cast<int>(kSteps.size())})) break;
  }
  Eigen::Vector3d parabola = Eigen::Vector3d::Zero();
  if (num_tried >= 3) {
    parabola = rows.topRows(num_tried).colPivHouseholderQr().solve(costs.head(num_tried));
  }
  const double curvature = std::max(0.0, 2 * parabola[0]) + 1 / (kPriorSigma * kPriorSigma);
  const double best = std::clamp(-parabola[1] / curvature, kSteps.front(), kSteps.back());
  return {.focal_px = usual.fx * std::exp(best), .relative_sigma = 1 / std::sqrt(curvature)};
}

}  // namespace mpc
