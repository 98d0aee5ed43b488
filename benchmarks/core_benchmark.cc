// Speed of mpc::core beside plain baselines; names as in README.md.

#include <benchmark/benchmark.h>
#include <ceres/jet.h>

#include <cmath>
#include <numbers>
#include <random>

#include "mpc/core/camera.h"
#include "mpc/core/contour2d.h"

namespace mpc {
namespace {

Camera DistortedCamera() {
  Camera camera = Camera::FromFov(1920, 1080, 1.2);
  camera.distortion = {-0.28, 0.09, 0.0011, -0.0007, -0.012};
  return camera;
}

std::vector<Eigen::Vector3d> RandomPoints() {
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> side(-1, 1), depth(3, 5);
  std::vector<Eigen::Vector3d> points(1000);
  for (auto& x : points) x << side(rng), side(rng), depth(rng);
  return points;
}

void ProjectWithJacobian(benchmark::State& state) {
  const Camera camera = DistortedCamera();
  const std::vector<Eigen::Vector3d> points = RandomPoints();
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> jacobian;
  for (auto _ : state) {
    for (const Eigen::Vector3d& x : points) {
      benchmark::DoNotOptimize(Project(camera, x, &pixel, &jacobian));
      benchmark::DoNotOptimize(jacobian.data());
      benchmark::ClobberMemory();
    }
  }
}
BENCHMARK(ProjectWithJacobian);

// The same formula by automatic differentiation, without the check of the invertible range.
void ProjectWithJacobian_BaselineAutoDiff(benchmark::State& state) {
  using Jet = ceres::Jet<double, 3>;
  const Camera camera = DistortedCamera();
  const auto& [k1, k2, p1, p2, k3] = camera.distortion;
  const std::vector<Eigen::Vector3d> points = RandomPoints();
  for (auto _ : state) {
    for (const Eigen::Vector3d& x : points) {
      const Jet z(x.z(), 2);
      const Jet u = Jet(x.x(), 0) / z, v = Jet(x.y(), 1) / z;
      const Jet s = u * u + v * v;
      const Jet radial = 1.0 + s * (k1 + s * (k2 + s * k3));
      Jet pixel[2] = {
          camera.fx * (radial * u + 2.0 * p1 * u * v + p2 * (s + 2.0 * u * u)) + camera.cx,
          camera.fy * (radial * v + p1 * (s + 2.0 * v * v) + 2.0 * p2 * u * v) + camera.cy};
      benchmark::DoNotOptimize(pixel);
      benchmark::ClobberMemory();
    }
  }
}
BENCHMARK(ProjectWithJacobian_BaselineAutoDiff);

void UndistortPixel(benchmark::State& state) {
  const Camera camera = DistortedCamera();
  for (auto _ : state) {
    for (int x = 0; x < 1000; ++x) {
      benchmark::DoNotOptimize(Undistort(camera, Eigen::Vector2d(1.9 * x, x)));
    }
  }
}
BENCHMARK(UndistortPixel);

// An ellipse with 2000 points, about the outline of a person at 1080p, and 1000 queries near it.
struct ContourQueries {
  Contour2d contour;
  Eigen::Matrix2Xd points, normals;

  ContourQueries() {
    Around(2000, 0, &contour.points, &contour.normals);
    Around(1000, 8, &points, &normals);
  }
  static void Around(int n, double noise_px, Eigen::Matrix2Xd* points, Eigen::Matrix2Xd* normals) {
    std::mt19937 rng(2);
    std::normal_distribution<double> noise;
    points->resize(2, n);
    normals->resize(2, n);
    for (int i = 0; i < n; ++i) {
      const double a = 2 * std::numbers::pi * i / n;
      points->col(i) << 960 + 150 * std::cos(a) + noise_px * noise(rng),
          540 + 450 * std::sin(a) + noise_px * noise(rng);
      normals->col(i) = Eigen::Vector2d(450 * std::cos(a), 150 * std::sin(a)).normalized();
    }
  }
};

constexpr double kReach_px = 40;
constexpr double kMinCos = 0.7;

void ContourNearest(benchmark::State& state) {
  const ContourQueries queries;
  const ContourIndex index(queries.contour);
  for (auto _ : state) {
    for (Eigen::Index i = 0; i < queries.points.cols(); ++i) {
      benchmark::DoNotOptimize(
          index.Nearest(queries.points.col(i), queries.normals.col(i), kReach_px, kMinCos));
    }
  }
}
BENCHMARK(ContourNearest);

void ContourNearest_BaselineBruteForce(benchmark::State& state) {
  const ContourQueries queries;
  const Contour2d& contour = queries.contour;
  for (auto _ : state) {
    for (Eigen::Index i = 0; i < queries.points.cols(); ++i) {
      Eigen::Index best = -1;
      double best_sq = kReach_px * kReach_px;
      for (Eigen::Index k = 0; k < contour.points.cols(); ++k) {
        const double distance_sq = (contour.points.col(k) - queries.points.col(i)).squaredNorm();
        if (distance_sq < best_sq &&
            contour.normals.col(k).dot(queries.normals.col(i)) >= kMinCos) {
          best = k;
          best_sq = distance_sq;
        }
      }
      benchmark::DoNotOptimize(best);
    }
  }
}
BENCHMARK(ContourNearest_BaselineBruteForce);

}  // namespace
}  // namespace mpc
