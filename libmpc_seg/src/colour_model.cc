#include "mpc/seg/colour_model.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr int kMeansIterations = 8;
// Variance of a camera's noise and of rounding, added to every component, colour steps^2.
constexpr double kNoiseVariance = 1;
constexpr float kNegligible = -60;  // log of a density; smaller ones count as none

// Uniform in [0, 1), the same on every platform.
double Uniform(std::mt19937* rng) { return static_cast<double>((*rng)()) / 4294967296.0; }

// k-means++: each further centre is drawn in proportion to the squared distance from those before.
std::vector<Eigen::Vector3f> DrawCentres(std::span<const WeightedColour> colours, int max_centres) {
  std::mt19937 rng(1);
  std::vector<Eigen::Vector3f> centres;
  std::vector<double> distance(colours.size(), 1.0);
  while (static_cast<int>(centres.size()) < max_centres) {
    double total = 0;
    for (size_t i = 0; i < colours.size(); ++i) total += colours[i].weight * distance[i];
    if (!(total > 0)) break;
    double rest = Uniform(&rng) * total;
    size_t chosen = 0;
    for (size_t i = 0; i < colours.size(); ++i) {
      const double share = colours[i].weight * distance[i];
      if (share <= 0) continue;
      chosen = i;
      rest -= share;
      if (rest < 0) break;
    }
    centres.push_back(colours[chosen].bgr);
    for (size_t i = 0; i < colours.size(); ++i) {
      const double d = (colours[i].bgr - centres.back()).squaredNorm();
      distance[i] = centres.size() == 1 ? d : std::min(distance[i], d);
    }
  }
  return centres;
}

// Column by column, so that several colours are compared at a time.
using ColourColumns = Eigen::ArrayX3f;

std::vector<int> NearestCentres(const ColourColumns& colours,
                                std::span<const Eigen::Vector3f> centres) {
  const auto n = static_cast<size_t>(colours.rows());
  const float *b = colours.col(0).data(), *g = colours.col(1).data(), *r = colours.col(2).data();
  // Squared distances as integers, which are in the same order, and no branches: so that compilers compare
  // several at a time.
  std::vector<int32_t> best(n, std::numeric_limits<int32_t>::max());
  std::vector<int> label(n);
  for (size_t k = 0; k < centres.size(); ++k) {
    const float b0 = centres[k][0], g0 = centres[k][1], r0 = centres[k][2];
    const int this_label = static_cast<int>(k);
    for (size_t i = 0; i < n; ++i) {
      const float db = b[i] - b0, dg = g[i] - g0, dr = r[i] - r0;
      const auto d = std::bit_cast<int32_t>(db * db + dg * dg + dr * dr);
      const int32_t closer = d < best[i] ? -1 : 0;
      label[i] ^= (label[i] ^ this_label) & closer;
      best[i] ^= (best[i] ^ d) & closer;
    }
  }
  return label;
}

// Of the colours with each label, but of those that no colour has.
std::vector<Eigen::Vector3f> Means(std::span<const WeightedColour> colours,
                                   std::span<const int> label, size_t num_labels) {
  std::vector<Eigen::Vector4d> sums(num_labels, Eigen::Vector4d::Zero());
  for (size_t i = 0; i < colours.size(); ++i) {
    const double weight = colours[i].weight;
    if (weight > 0) sums[label[i]] += weight * colours[i].bgr.homogeneous().cast<double>();
  }
  std::vector<Eigen::Vector3f> means;
  for (const Eigen::Vector4d& sum : sums) {
    if (sum[3] > 0) means.push_back(sum.hnormalized().cast<float>());
  }
  return means;
}

std::vector<ColourComponent> Components(std::span<const WeightedColour> colours,
                                        std::span<const int> label, int num_labels) {
  struct Sums {
    double weight = 0;
    Eigen::Vector3d first = Eigen::Vector3d::Zero();
    Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  };
  std::vector<Sums> sums(static_cast<size_t>(num_labels));
  double total = 0;
  for (size_t i = 0; i < colours.size(); ++i) {
    const double weight = colours[i].weight;
    if (!(weight > 0)) continue;
    const Eigen::Vector3d bgr = colours[i].bgr.cast<double>();
    Sums& s = sums[label[i]];
    s.weight += weight;
    s.first += weight * bgr;
    s.second.noalias() += (weight * bgr) * bgr.transpose();
    total += weight;
  }
  std::vector<ColourComponent> components;
  for (const Sums& s : sums) {
    if (!(s.weight > 0)) continue;
    ColourComponent component;
    component.weight = s.weight / total;
    component.mean = s.first / s.weight;
    component.covariance = s.second / s.weight - component.mean * component.mean.transpose() +
                           kNoiseVariance * Eigen::Matrix3d::Identity();
    components.push_back(component);
  }
  return components;
}

}  // namespace

ColourModel::ColourModel(std::span<const WeightedColour> colours, int max_components,
                         int num_refits) {
  std::vector<Eigen::Vector3f> centres = DrawCentres(colours, std::max(1, max_components));
  if (centres.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "colour model: no colours to learn from");
  }
  ColourColumns columns(std::ssize(colours), 3);
  for (Eigen::Index i = 0; i < columns.rows(); ++i) {
    columns.row(i) = colours[static_cast<size_t>(i)].bgr.transpose();
  }
  std::vector<int> label = NearestCentres(columns, centres);
  for (int iteration = 1; iteration < kMeansIterations; ++iteration) {
    centres = Means(colours, label, centres.size());
    label = NearestCentres(columns, centres);
  }
  SetComponents(Components(colours, label, static_cast<int>(centres.size())));
  for (int refit = 0; refit < num_refits; ++refit) {
    for (size_t i = 0; i < colours.size(); ++i) label[i] = LikeliestComponent(colours[i].bgr);
    SetComponents(Components(colours, label, static_cast<int>(components_.size())));
  }
}

void ColourModel::SetComponents(std::vector<ColourComponent> components) {
  components_ = std::move(components);
  kernels_.clear();
  for (const ColourComponent& component : components_) {
    const Eigen::LLT<Eigen::Matrix3d> llt(component.covariance);
    const Eigen::Matrix3d lower = llt.matrixL();
    const Eigen::Matrix3d whitener = lower.inverse();
    kernels_.push_back(
        {component.mean.cast<float>(), whitener.cast<float>(),
         static_cast<float>(std::log(component.weight) - 1.5 * std::log(2 * std::numbers::pi) -
                            std::log(lower.determinant()))});
  }
}

namespace {

// log of weight times density.
template <typename Kernel>
float LogDensity(const Kernel& kernel, const Eigen::Vector3f& bgr) {
  const Eigen::Vector3f d = bgr - kernel.mean;
  const Eigen::Matrix3f& w = kernel.whitener;
  const float x = w(0, 0) * d[0];
  const float y = w(1, 0) * d[0] + w(1, 1) * d[1];
  const float z = w(2, 0) * d[0] + w(2, 1) * d[1] + w(2, 2) * d[2];
  return kernel.log_scale - 0.5F * (x * x + y * y + z * z);
}

}  // namespace

int ColourModel::LikeliestComponent(const Eigen::Vector3f& bgr) const {
  int best = 0;
  float best_log = -std::numeric_limits<float>::max();
  for (size_t k = 0; k < kernels_.size(); ++k) {
    const float log_density = LogDensity(kernels_[k], bgr);
    if (log_density > best_log) {
      best_log = log_density;
      best = static_cast<int>(k);
    }
  }
  return best;
}

void ColourModel::ComponentDensities(const Eigen::Vector3f& bgr, float* densities) const {
  for (size_t k = 0; k < kernels_.size(); ++k) {
    const float log_density = LogDensity(kernels_[k], bgr);
    densities[k] = log_density < kNegligible
                       ? 0
                       : std::exp(log_density) / static_cast<float>(components_[k].weight);
  }
}

float ColourModel::NegLogLikelihood(const Eigen::Vector3f& bgr) const {
  // log(sum exp) with the largest term taken out, so that far colours do not underflow.
  float largest = -std::numeric_limits<float>::max();
  float sum = 0;
  for (const Kernel& kernel : kernels_) {
    const float log_density = LogDensity(kernel, bgr);
    if (log_density > largest) {
      sum = sum * std::exp(largest - log_density) + 1;
      largest = log_density;
    } else {
      sum += std::exp(log_density - largest);
    }
  }
  return -(largest + std::log(sum));
}

}  // namespace mpc
