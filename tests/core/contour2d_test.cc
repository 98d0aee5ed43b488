#include "mpc/core/contour2d.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "support/expect_error.h"

namespace mpc {
namespace {

int NearestByBruteForce(const Contour2d& contour, const Eigen::Vector2d& point,
                        const Eigen::Vector2d& normal, double max_distance, double min_cos) {
  int best = -1;
  double best_sq = max_distance * max_distance;
  for (int i = 0; i < contour.points.cols(); ++i) {
    const double distance_sq = (contour.points.col(i) - point).squaredNorm();
    if (contour.normals.col(i).dot(normal) < min_cos) continue;
    if (distance_sq < best_sq || (best < 0 && distance_sq == best_sq)) {
      best = i;
      best_sq = distance_sq;
    }
  }
  return best;
}

Contour2d RandomContour(int num_points, double size, std::mt19937* rng) {
  // Whole-numbered points, so that equal distances happen.
  std::uniform_int_distribution<int> coordinate(0, static_cast<int>(size));
  std::uniform_real_distribution<double> angle(0, 6.28);
  Contour2d contour;
  contour.points.resize(2, num_points);
  contour.normals.resize(2, num_points);
  for (int i = 0; i < num_points; ++i) {
    const double a = angle(*rng);
    contour.points.col(i) << coordinate(*rng), coordinate(*rng);
    contour.normals.col(i) << std::cos(a), std::sin(a);
  }
  return contour;
}

TEST(ContourIndexTest, AgreesWithBruteForce) {
  std::mt19937 rng(5);
  for (const double cell_px : {1.0, 8.0, 1000.0}) {
    const Contour2d contour = RandomContour(400, 120, &rng);
    const ContourIndex index(contour, cell_px);
    std::uniform_int_distribution<int> coordinate(-60, 180);
    std::uniform_real_distribution<double> angle(0, 6.28), reach(0, 90), cosine(-1, 1);
    int found = 0;
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector2d point(coordinate(rng), coordinate(rng));
      const double a = angle(rng), max_distance = reach(rng), min_cos = cosine(rng);
      const Eigen::Vector2d normal(std::cos(a), std::sin(a));
      const int expected = NearestByBruteForce(contour, point, normal, max_distance, min_cos);
      ASSERT_EQ(index.Nearest(point, normal, max_distance, min_cos), expected);
      found += expected >= 0;
    }
    EXPECT_GT(found, 100);
    EXPECT_LT(found, 500);
  }
}

TEST(ContourIndexTest, UnlimitedReachFindsTheNearestFromAnywhere) {
  std::mt19937 rng(6);
  const Contour2d contour = RandomContour(50, 40, &rng);
  const ContourIndex index(contour);
  const double inf = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& point :
       {Eigen::Vector2d(1e6, -3), Eigen::Vector2d(-500, 70), Eigen::Vector2d(20, 20)}) {
    EXPECT_EQ(index.Nearest(point, {1, 0}, inf, -1),
              NearestByBruteForce(contour, point, {1, 0}, inf, -1));
  }
}

TEST(ContourIndexTest, ReachAndAngleIncludeTheirLimits) {
  Contour2d contour;
  contour.points = Eigen::Vector2d(3, 4);
  contour.normals = Eigen::Vector2d(1, 0);
  const ContourIndex index(contour);
  EXPECT_EQ(index.Nearest({0, 0}, {1, 0}, 5, 1), 0);
  EXPECT_EQ(index.Nearest({0, 0}, {1, 0}, 4.999, 1), -1);
  EXPECT_EQ(index.Nearest({0, 0}, {0, 1}, 5, 0), 0);
  EXPECT_EQ(index.Nearest({0, 0}, {0, 1}, 5, 0.001), -1);
}

TEST(ContourIndexTest, EmptyAndFarApart) {
  EXPECT_EQ(ContourIndex(Contour2d()).Nearest({0, 0}, {1, 0}, 10, -1), -1);
  Contour2d contour;
  contour.points.resize(2, 2);
  contour.points << -1e12, 1e12, -1e12, 1e12;
  contour.normals.setConstant(2, 2, std::sqrt(0.5));
  const ContourIndex index(contour, 0.5);  // must not allocate 10^25 cells
  EXPECT_EQ(index.Nearest({1e12, 1e12 - 3}, {1, 0}, 5, 0), 1);
}

TEST(ContourIndexTest, RefusesBadInput) {
  Contour2d contour;
  contour.points.setZero(2, 2);
  contour.normals.setZero(2, 1);
  EXPECT_MPC_ERROR(ContourIndex{contour}, kInvalidArgument, "2 points but 1 normals");
  contour.normals.setZero(2, 2);
  EXPECT_MPC_ERROR(ContourIndex(contour, 0), kInvalidArgument, "cell size 0");
  contour.points(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_MPC_ERROR(ContourIndex{contour}, kInvalidArgument, "not finite");
}

}  // namespace
}  // namespace mpc
