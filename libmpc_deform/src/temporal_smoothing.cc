#include "mpc/deform/temporal_smoothing.h"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <string>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/skeleton/skinning.h"

namespace mpc {
namespace {

constexpr float kSureEvidence = 3;  // correspondences that say half of where a vertex is; ours

// x [-] base: translation, left rotation vector, angles.
Eigen::VectorXd Difference(const Eigen::VectorXd& x, const Eigen::VectorXd& base) {
  Eigen::VectorXd difference = x - base;
  difference.segment<3>(3) =
      LogSO3(ExpSO3(x.segment<3>(3)) * ExpSO3(base.segment<3>(3)).transpose());
  return difference;
}

Eigen::VectorXd Plus(const Eigen::VectorXd& base, const Eigen::VectorXd& difference) {
  Eigen::VectorXd x = base + difference;
  x.segment<3>(3) = LogSO3(ExpSO3(difference.segment<3>(3)) * ExpSO3(base.segment<3>(3)));
  return x;
}

// Weights with which least squares of a polynomial through values at `times` gives that at time 0.
Eigen::VectorXd PolynomialWeights(const Eigen::VectorXd& times, int degree) {
  const int terms = std::min(degree + 1, static_cast<int>(times.size()));
  Eigen::MatrixXd powers = Eigen::MatrixXd::Ones(times.size(), terms);
  for (int d = 1; d < terms; ++d) powers.col(d) = powers.col(d - 1).cwiseProduct(times);
  return powers.householderQr()
      .solve(Eigen::MatrixXd::Identity(times.size(), times.size()))
      .row(0)
      .transpose();
}

// Every vertex turned by its blended rotation from the bind pose, or by the inverse: skinned by
// motions that do not shift.
void Turn(const Character& character, const KinematicState& state, bool inverse,
          Eigen::Matrix3Xf* displacements) {
  if (displacements->cols() != character.segments.cols()) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{} displacements of a mesh with {} vertices", displacements->cols(),
                            character.segments.cols()));
  }
  std::vector<DualQuaternion> motions;
  SegmentMotions(character.bind, state, &motions);
  for (DualQuaternion& motion : motions) {
    motion.dual.setZero();
    if (inverse) motion.real.tail<3>() *= -1;
  }
  Eigen::Matrix3Xf turned(3, displacements->cols());
  SkinDualQuaternion(*displacements, character.segments, character.weights, motions, &turned);
  displacements->swap(turned);
}

}  // namespace

SmoothingOptions SmoothingOptions::Paper() {
  SmoothingOptions options;
  options.degree = 1;
  options.depth_seconds = 0;
  options.keep_m = 0;
  return options;
}

void SmoothingOptions::Validate() const {
  std::string faults;
  if (window_frames < 1 || window_frames % 2 == 0) {
    faults += fmt::format("window_frames is {}, expected an odd number", window_frames);
  }
  if (degree < 0 || degree > 2) {
    faults += fmt::format("{}degree is {}, expected 0 to 2", faults.empty() ? "" : "; ", degree);
  }
  if (!(depth_seconds >= 0 && depth_seconds <= 10)) {
    faults += fmt::format("{}depth_seconds is {}, expected 0 to 10", faults.empty() ? "" : "; ",
                          depth_seconds);
  }
  if (!(keep_m >= 0 && keep_m <= 10)) {
    faults += fmt::format("{}keep_m is {}, expected 0 to 10", faults.empty() ? "" : "; ", keep_m);
  }
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "smoothing: " + faults);
}

Eigen::VectorXd SmoothingWeights(const std::vector<bool>& usable, const SmoothingOptions& options) {
  options.Validate();
  if (static_cast<int>(usable.size()) != options.window_frames) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("window of {} frames, expected {}",
                                                         usable.size(), options.window_frames));
  }
  const int reach = options.window_frames / 2;
  std::vector<int> frames;
  for (int i = 0; i < options.window_frames; ++i) {
    if (usable[static_cast<size_t>(i)]) frames.push_back(i);
  }
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(options.window_frames);
  if (frames.empty()) return weights;

  const Eigen::VectorXd times =
      Eigen::VectorXi::Map(frames.data(), static_cast<Eigen::Index>(frames.size()))
          .cast<double>()
          .array() -
      reach;
  const double before = times.head<1>()[0], after = times.tail<1>()[0];
  if (usable[static_cast<size_t>(reach)] || (before < 0 && after > 0)) {
    weights(frames) = PolynomialWeights(times, options.degree);
  } else {
    const double distance = before > 0 ? before : -after;
    weights(frames).setConstant((1 - distance / (reach + 1)) / static_cast<double>(frames.size()));
  }
  return weights;
}

double SmoothedMiddle(const Eigen::VectorXd& values) {
  const Eigen::Index middle = values.size() / 2;
  if (std::isnan(values[middle])) return values[middle];
  Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
  Eigen::Vector2d sums = Eigen::Vector2d::Zero();
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (std::isnan(values[i])) continue;
    const double time = static_cast<double>(i - middle) / static_cast<double>(middle + 1);
    const double weight = (1 - time * time) * (1 - time * time);
    const Eigen::Vector2d powers(1, time);
    moments += weight * powers * powers.transpose();
    sums += weight * values[i] * powers;
  }
  // One value alone says nothing of a slope.
  return moments.completeOrthogonalDecomposition().solve(sums)[0];
}

Eigen::MatrixXd SmoothPoses(const Skeleton& skeleton, const Eigen::MatrixXd& batch,
                            const Eigen::MatrixXd& refined, const std::vector<bool>& is_refined,
                            const SmoothingOptions& options) {
  const Eigen::Index num_frames = batch.cols();
  if (batch.rows() != skeleton.num_dofs() || refined.rows() != batch.rows() ||
      refined.cols() != num_frames || static_cast<Eigen::Index>(is_refined.size()) != num_frames) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("smoothing: batch {} x {}, refined {} x {}, {} flags, {} dofs",
                            batch.rows(), batch.cols(), refined.rows(), refined.cols(),
                            is_refined.size(), skeleton.num_dofs()));
  }
  options.Validate();
  const Eigen::VectorXd lower = skeleton.LowerBounds(), upper = skeleton.UpperBounds();
  const int reach = options.window_frames / 2;
  const auto is_inside = [&](Eigen::Index f) { return f >= 0 && f < num_frames; };
  // Weights of the window around a frame, over those of its frames for which known(g) holds.
  const auto window = [&](Eigen::Index f, const auto& known) {
    std::vector<bool> usable;
    for (Eigen::Index g = f - reach; g <= f + reach; ++g) usable.push_back(known(g));
    return SmoothingWeights(usable, options);
  };
  const auto was_refined = [&](Eigen::Index f) {
    return is_inside(f) && is_refined[static_cast<size_t>(f)];
  };

  // Where refinement was refused its neighbours' correction is the best guess.
  Eigen::MatrixXd filled = batch;
  std::vector<bool> keeps_batch(static_cast<size_t>(num_frames), false);
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    const Eigen::VectorXd weights = window(f, was_refined);
    keeps_batch[static_cast<size_t>(f)] = weights.isZero(0);
    if (was_refined(f)) {
      filled.col(f) = refined.col(f);
      continue;
    }
    Eigen::VectorXd correction = Eigen::VectorXd::Zero(batch.rows());
    for (Eigen::Index i = 0; i < options.window_frames; ++i) {
      const Eigen::Index g = f - reach + i;
      if (was_refined(g)) correction += weights[i] * Difference(refined.col(g), batch.col(g));
    }
    filled.col(f) = Plus(batch.col(f), correction);
  }

  Eigen::MatrixXd smoothed = batch;
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    if (keeps_batch[static_cast<size_t>(f)]) continue;
    const Eigen::VectorXd weights = window(f, is_inside);
    Eigen::VectorXd difference = Eigen::VectorXd::Zero(batch.rows());
    for (Eigen::Index i = 0; i < options.window_frames; ++i) {
      const Eigen::Index g = f - reach + i;
      if (is_inside(g)) difference += weights[i] * Difference(filled.col(g), filled.col(f));
    }
    smoothed.col(f) = Plus(filled.col(f), difference).cwiseMax(lower).cwiseMin(upper);
  }
  return smoothed;
}

void TurnToBind(const Character& character, const KinematicState& state,
                Eigen::Matrix3Xf* displacements) {
  Turn(character, state, /*inverse=*/true, displacements);
}

void TurnFromBind(const Character& character, const KinematicState& state,
                  Eigen::Matrix3Xf* displacements) {
  Turn(character, state, /*inverse=*/false, displacements);
}

Eigen::Matrix3Xf SmoothDisplacements(std::span<const Eigen::Matrix3Xf> window,
                                     const SmoothingOptions& options) {
  std::vector<bool> usable;
  for (const Eigen::Matrix3Xf& displacements : window) usable.push_back(displacements.cols() > 0);
  const Eigen::VectorXd weights = SmoothingWeights(usable, options);
  Eigen::Matrix3Xf smoothed;
  for (size_t i = 0; i < window.size(); ++i) {
    if (!usable[i]) continue;
    if (smoothed.cols() == 0) smoothed.setZero(3, window[i].cols());
    if (window[i].cols() != smoothed.cols()) {
      throw Error(ErrorCode::kMismatch,
                  fmt::format("smoothing: frames with {} and {} displacements", smoothed.cols(),
                              window[i].cols()));
    }
    smoothed += static_cast<float>(weights[static_cast<Eigen::Index>(i)]) * window[i];
  }
  return smoothed;
}

void KeepSeen(const Eigen::Matrix3Xf& refined, const Eigen::VectorXf& evidence, double keep_m,
              Eigen::Matrix3Xf* smoothed) {
  if (refined.cols() != smoothed->cols() || evidence.size() != smoothed->cols()) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("smoothing: {} vertices, {} refined ones with {} weights",
                            smoothed->cols(), refined.cols(), evidence.size()));
  }
  const auto square = static_cast<float>(keep_m * keep_m);
  for (Eigen::Index v = 0; v < refined.cols(); ++v) {
    const bool in_front = refined(2, v) > 0 && (*smoothed)(2, v) > 0;
    if (!in_front || evidence[v] <= 0) continue;
    const Eigen::Vector3f at_depth = refined.col(v) * ((*smoothed)(2, v) / refined(2, v));
    const Eigen::Vector3f way = at_depth - smoothed->col(v);
    const float far = way.squaredNorm() / (way.squaredNorm() + square);
    smoothed->col(v) += far * evidence[v] / (evidence[v] + kSureEvidence) * way;
  }
}

}  // namespace mpc
