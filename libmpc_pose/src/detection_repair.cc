#include "mpc/pose/detection_repair.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

namespace mpc {
namespace {

constexpr double kHalfWindowSeconds = 0.2;
constexpr double kMinFps = 15;
constexpr int kMaxHalfSamples = 6;  // samples per side; faster videos are thinned to it
constexpr int kMinSamples = 6;      // the quadratic has three unknowns
constexpr int kMinSide = 2;         // samples needed on either side
constexpr int kRounds = 4;
constexpr double kOutlierFactor = 3;  // times the median residual of the window
constexpr double kRepairedConfidence = 0.5;
constexpr double kSlack3dM = 0.03;       // residuals below it are never outliers
constexpr double kSlack2dExtent = 0.01;  // the same as a fraction of the person's extent
constexpr double kMaxScatter = 5;        // times that slack; wilder tracks are left alone

template <int kDim>
struct Sample {
  double t = 0;  // in half windows from the frame
  Eigen::Matrix<double, kDim, 1> x;
  double confidence = 0;
  double residual = 0;
};

// The value at t = 0 of a quadratic fitted to the samples, outliers weighed down; residuals are left
// in the samples, their median is returned in *scatter.
template <int kDim>
Eigen::Matrix<double, kDim, 1> FitLocally(double slack, std::vector<Sample<kDim>>* samples,
                                          double* scatter) {
  std::vector<double> residuals(samples->size());
  Eigen::Matrix<double, 3, kDim> fit;
  double scale = 0;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d a = Eigen::Matrix3d::Identity() * 1e-9;
    Eigen::Matrix<double, 3, kDim> b = Eigen::Matrix<double, 3, kDim>::Zero();
    for (const Sample<kDim>& sample : *samples) {
      const Eigen::Vector3d powers(1, sample.t, sample.t * sample.t);
      const double relative = round == 0 ? 0 : sample.residual / scale;
      const double taper = 1 - 0.9 * sample.t * sample.t;
      const double trust = 1 / (1 + relative * relative);
      a += taper * trust * trust * powers * powers.transpose();
      b += taper * trust * trust * powers * sample.x.transpose();
    }
    fit = a.ldlt().solve(b);
    for (size_t i = 0; i < samples->size(); ++i) {
      Sample<kDim>& sample = (*samples)[i];
      const Eigen::Vector3d powers(1, sample.t, sample.t * sample.t);
      residuals[i] = sample.residual = (fit.transpose() * powers - sample.x).norm();
    }
    const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
    std::nth_element(residuals.begin(), middle, residuals.end());
    *scatter = *middle;
    scale = kOutlierFactor * *scatter + slack;
  }
  return fit.row(0).transpose();
}

// One joint's track: positions (kDim x F) and confidences (F, 0: missing).
template <int kDim>
void RepairTrack(int half_window, double slack, Eigen::Matrix<double, kDim, Eigen::Dynamic>* track,
                 Eigen::VectorXd* confidences) {
  const Eigen::Matrix<double, kDim, Eigen::Dynamic> raw = *track;
  const Eigen::VectorXd seen = *confidences;
  const int num_frames = static_cast<int>(seen.size());
  const int stride = std::max(1, half_window / kMaxHalfSamples);
  std::vector<Sample<kDim>> samples;
  for (int f = 0; f < num_frames; ++f) {
    samples.clear();
    int before = 0;
    int after = 0;
    double confidence = 0;
    double residual = 0;
    for (int g = f - half_window / stride * stride; g <= f + half_window; g += stride) {
      if (g == f || g < 0 || g >= num_frames || seen[g] <= 0) continue;
      samples.push_back({static_cast<double>(g - f) / half_window, raw.col(g), seen[g], 0});
      confidence += seen[g];
      before += g < f ? 1 : 0;
      after += g > f ? 1 : 0;
    }
    const bool missing = seen[f] <= 0;
    // Never extrapolated.
    if (before + after < kMinSamples || before < kMinSide || after < kMinSide) continue;
    double scatter = 0;
    const Eigen::Matrix<double, kDim, 1> fit = FitLocally(slack, &samples, &scatter);
    if (!missing) residual = (raw.col(f) - fit).norm();
    if (scatter > kMaxScatter * slack) continue;
    if (!missing && residual <= kOutlierFactor * scatter + slack) continue;
    track->col(f) = fit;
    (*confidences)[f] = kRepairedConfidence * confidence / static_cast<double>(samples.size());
  }
}

int HalfWindow(double fps) { return static_cast<int>(std::lround(kHalfWindowSeconds * fps)); }

}  // namespace

Detections2d RepairDetections(const Detections2d& detections, double fps) {
  Detections2d repaired = detections;
  const int num_frames = static_cast<int>(detections.frames.size());
  if (fps < kMinFps || num_frames < kMinSamples) return repaired;
  std::vector<double> extents;
  for (const Detections2d::Frame& frame : detections.frames) {
    Eigen::Array2d low = Eigen::Array2d::Constant(1e300);
    Eigen::Array2d high = -low;
    for (int j = 0; j < frame.confidence.size(); ++j) {
      if (frame.confidence[j] <= 0) continue;
      low = low.min(frame.pixels.col(j).array());
      high = high.max(frame.pixels.col(j).array());
    }
    if ((high > low).any()) extents.push_back((high - low).matrix().norm());
  }
  if (extents.empty()) return repaired;
  const auto middle = extents.begin() + static_cast<std::ptrdiff_t>(extents.size() / 2);
  std::nth_element(extents.begin(), middle, extents.end());
  for (size_t j = 0; j < detections.joints.size(); ++j) {
    Eigen::Matrix2Xd track(2, num_frames);
    Eigen::VectorXd confidences(num_frames);
    for (int f = 0; f < num_frames; ++f) {
      track.col(f) = detections.frames[f].pixels.col(j);
      confidences[f] = detections.frames[f].confidence[j];
    }
    RepairTrack<2>(HalfWindow(fps), kSlack2dExtent * *middle, &track, &confidences);
    for (int f = 0; f < num_frames; ++f) {
      repaired.frames[f].pixels.col(j) = track.col(f);
      repaired.frames[f].confidence[j] = confidences[f];
    }
  }
  return repaired;
}

Detections3d RepairDetections(const Detections3d& detections, double fps) {
  Detections3d repaired = detections;
  const int num_frames = static_cast<int>(detections.frames.size());
  if (fps < kMinFps || num_frames < kMinSamples) return repaired;
  for (size_t j = 0; j < detections.joints.size(); ++j) {
    Eigen::Matrix3Xd track(3, num_frames);
    Eigen::VectorXd confidences(num_frames);
    for (int f = 0; f < num_frames; ++f) {
      track.col(f) = detections.frames[f].positions.col(j);
      confidences[f] = detections.frames[f].confidence[j];
    }
    RepairTrack<3>(HalfWindow(fps), kSlack3dM, &track, &confidences);
    for (int f = 0; f < num_frames; ++f) {
      repaired.frames[f].positions.col(j) = track.col(f);
      repaired.frames[f].confidence[j] = confidences[f];
    }
  }
  return repaired;
}

}  // namespace mpc
