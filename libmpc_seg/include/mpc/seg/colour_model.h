// Purpose: what colours a region has: a mixture of Gaussians in BGR.
// Source: Rother et al., "GrabCut", 2004 (5 components, full covariances).
// Units: 8-bit colour steps, natural logarithms. Symbols: K components.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace mpc {

struct WeightedColour {
  Eigen::Vector3f bgr;
  float weight = 1;
};

struct ColourComponent {
  double weight = 0;  // they sum to 1
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

class ColourModel {
 public:
  // k-means++ (seeded), then `num_refits` times: colours to their likeliest component, components
  // from their colours. Components that no colour needs are left out, so K <= max_components.
  // Needs at least one colour of positive weight; throws Error (kInvalidArgument) otherwise.
  ColourModel(std::span<const WeightedColour> colours, int max_components, int num_refits = 1);

  const std::vector<ColourComponent>& components() const { return components_; }

  // Densities of the components at a colour, without their weights; K numbers.
  void ComponentDensities(const Eigen::Vector3f& bgr, float* densities) const;

  // The component that explains a colour best.
  int LikeliestComponent(const Eigen::Vector3f& bgr) const;

  // -log p(bgr), densities per cubic colour step; finite for every colour.
  float NegLogLikelihood(const Eigen::Vector3f& bgr) const;

 private:
  struct Kernel {
    Eigen::Vector3f mean;
    Eigen::Matrix3f whitener;  // lower triangular; covariance^-1 = whitener^T whitener
    float log_scale;           // log of the weighted density at the mean
  };

  void SetComponents(std::vector<ColourComponent> components);

  std::vector<ColourComponent> components_;
  std::vector<Kernel> kernels_;
};

}  // namespace mpc
