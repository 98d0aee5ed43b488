#include "mpc/seg/colour_model.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

#include "support/expect_error.h"

namespace mpc {
namespace {

std::vector<WeightedColour> DrawColours(const std::vector<ColourComponent>& mixture, int n,
                                        uint32_t seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  std::vector<WeightedColour> colours;
  for (const ColourComponent& c : mixture) {
    const Eigen::Matrix3d root = c.covariance.llt().matrixL();
    for (int i = 0; i < static_cast<int>(n * c.weight); ++i) {
      const Eigen::Vector3d z(normal(rng), normal(rng), normal(rng));
      colours.push_back({(c.mean + root * z).cast<float>()});
    }
  }
  return colours;
}

std::vector<ColourComponent> ThreeComponents() {
  Eigen::Matrix3d slanted;
  slanted << 90, 60, 20, 60, 80, 10, 20, 10, 40;
  return {{0.5, {40, 50, 60}, 25 * Eigen::Matrix3d::Identity()},
          {0.3, {120, 130, 200}, slanted},
          {0.2, {220, 60, 30}, 16 * Eigen::Matrix3d::Identity()}};
}

TEST(ColourModel, RecoversAMixture) {
  const std::vector<ColourComponent> truth = ThreeComponents();
  const ColourModel model(DrawColours(truth, 6000, 1), 3);
  ASSERT_EQ(model.components().size(), 3);
  for (const ColourComponent& expected : truth) {
    const auto nearest = std::min_element(
        model.components().begin(), model.components().end(), [&](const auto& a, const auto& b) {
          return (a.mean - expected.mean).norm() < (b.mean - expected.mean).norm();
        });
    EXPECT_NEAR(nearest->weight, expected.weight, 0.01);
    EXPECT_LT((nearest->mean - expected.mean).norm(), 1);
    // Colours belong to one component each, which makes neighbouring components a little narrow.
    EXPECT_LT((nearest->covariance - expected.covariance).norm(), 0.2 * expected.covariance.norm());
  }
}

TEST(ColourModel, LikelihoodIsThatOfTheMixture) {
  const ColourModel model(DrawColours(ThreeComponents(), 3000, 2), 5);
  std::mt19937 rng(3);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d c =
        Eigen::Vector3d::NullaryExpr([&rng] { return static_cast<double>(rng() % 256); });
    double density = 0;
    for (const ColourComponent& k : model.components()) {
      const Eigen::Vector3d d = c - k.mean;
      density += k.weight * std::exp(-0.5 * d.dot(k.covariance.inverse() * d)) /
                 std::sqrt(std::pow(2 * M_PI, 3) * k.covariance.determinant());
    }
    const double expected = -std::log(density);
    if (!std::isfinite(expected)) continue;  // the plain sum underflows, ours does not
    EXPECT_NEAR(model.NegLogLikelihood(c.cast<float>()), expected,
                1e-3 * std::abs(expected) + 1e-3);
  }
}

TEST(ColourModel, WeightsCountAsRepetitions) {
  std::vector<WeightedColour> repeated, weighted;
  std::mt19937 rng(4);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3f c(static_cast<float>(rng() % 20), static_cast<float>(rng() % 20),
                            static_cast<float>(rng() % 20));
    const int times = 1 + i % 3;
    for (int k = 0; k < times; ++k) repeated.push_back({c});
    weighted.push_back({c, static_cast<float>(times)});
  }
  const ColourModel a(repeated, 1), b(weighted, 1);
  EXPECT_LT((a.components()[0].mean - b.components()[0].mean).norm(), 1e-4);
  EXPECT_LT((a.components()[0].covariance - b.components()[0].covariance).norm(), 1e-3);
}

TEST(ColourModel, OneColourIsOneComponentAndFinite) {
  const std::vector<WeightedColour> colours(100, {{7, 8, 9}});
  const ColourModel model(colours, 5);
  EXPECT_EQ(model.components().size(), 1);
  EXPECT_TRUE(std::isfinite(model.NegLogLikelihood({255, 255, 255})));
  EXPECT_LT(model.NegLogLikelihood({7, 8, 9}), model.NegLogLikelihood({9, 8, 9}));
}

TEST(ColourModel, SameColoursSameModel) {
  const auto colours = DrawColours(ThreeComponents(), 500, 5);
  const ColourModel a(colours, 5), b(colours, 5);
  ASSERT_EQ(a.components().size(), b.components().size());
  for (size_t k = 0; k < a.components().size(); ++k) {
    EXPECT_EQ(a.components()[k].mean, b.components()[k].mean);
    EXPECT_EQ(a.components()[k].covariance, b.components()[k].covariance);
  }
}

TEST(ColourModel, RefusesNothing) {
  EXPECT_MPC_ERROR(ColourModel({}, 5), kInvalidArgument, "no colours");
  const std::vector<WeightedColour> weightless(3, {{1, 2, 3}, 0});
  EXPECT_MPC_ERROR(ColourModel(weightless, 5), kInvalidArgument, "no colours");
}

}  // namespace
}  // namespace mpc
