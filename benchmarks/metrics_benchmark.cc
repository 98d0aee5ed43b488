// Speed of the surface metrics of mpc::eval beside plain baselines; names as in README.md.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "mpc/eval/closest_point.h"
#include "mpc/eval/metrics.h"
#include "mpc/eval/surface_metrics.h"

namespace mpc {
namespace {

// A bumpy sphere of `rings` x 2 rings quads, of a person's size, and the same a little off.
struct Surfaces {
  explicit Surfaces(int rings) {
    const int columns = 2 * rings;
    truth.resize(3, (rings + 1) * columns);
    triangles.resize(3, 2 * rings * columns);
    int t = 0;
    for (int i = 0; i <= rings; ++i) {
      for (int j = 0; j < columns; ++j) {
        const float a = 3.14159F * static_cast<float>(i) / static_cast<float>(rings);
        const float b = 6.28319F * static_cast<float>(j) / static_cast<float>(columns);
        const float r = 0.8F + 0.05F * std::sin(9 * a) * std::cos(7 * b);
        truth.col(i * columns + j) << r * std::sin(a) * std::cos(b), r * std::cos(a),
            r * std::sin(a) * std::sin(b);
        if (i == rings) continue;
        const int right = i * columns + (j + 1) % columns;
        triangles.col(t++) << i * columns + j, right, right + columns;
        triangles.col(t++) << i * columns + j, right + columns, (i + 1) * columns + j;
      }
    }
    estimate = 1.02F * truth;
    estimate.row(0).array() += 0.01F;
  }

  Eigen::Matrix3Xf truth;
  Eigen::Matrix3Xf estimate;
  Triangles triangles;
};

// Both directions of one frame, trees included; arguments: rings (20: 840 vertices, 80: 13,000).
void SurfaceDistance(benchmark::State& state) {
  const Surfaces surfaces(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    benchmark::DoNotOptimize(CompareSurfaces(surfaces.estimate, surfaces.truth, surfaces.triangles,
                                             Eigen::Vector3d::Zero()));
  }
  state.SetItemsProcessed(state.iterations() * 2 * surfaces.truth.cols());
}
BENCHMARK(SurfaceDistance)->Arg(20)->Arg(80)->Unit(benchmark::kMillisecond);

double BruteForce(const Eigen::Matrix3Xf& points, const Eigen::Matrix3Xf& surface,
                  const Triangles& triangles) {
  double sum = 0;
  for (const auto& point : points.colwise()) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& t : triangles.colwise()) {
      nearest =
          std::min(nearest, TriangleDistance(point.cast<double>(), surface.col(t[0]).cast<double>(),
                                             surface.col(t[1]).cast<double>(),
                                             surface.col(t[2]).cast<double>()));
    }
    sum += nearest;
  }
  return sum;
}

void SurfaceDistance_Baseline(benchmark::State& state) {
  const Surfaces surfaces(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    benchmark::DoNotOptimize(BruteForce(surfaces.estimate, surfaces.truth, surfaces.triangles) +
                             BruteForce(surfaces.truth, surfaces.estimate, surfaces.triangles));
  }
  state.SetItemsProcessed(state.iterations() * 2 * surfaces.truth.cols());
}
BENCHMARK(SurfaceDistance_Baseline)->Arg(20)->Unit(benchmark::kMillisecond);

void SurfaceTreeBuild(benchmark::State& state) {
  const Surfaces surfaces(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(SurfaceTree(surfaces.truth, surfaces.triangles));
}
BENCHMARK(SurfaceTreeBuild)->Arg(80)->Unit(benchmark::kMillisecond);

struct Masks {
  cv::Mat a = cv::Mat::zeros(720, 1280, CV_8UC1), b = a.clone();
  Masks() {
    cv::ellipse(a, {600, 360}, {150, 300}, 0, 0, 360, 255, cv::FILLED);
    cv::ellipse(b, {605, 362}, {150, 300}, 3, 0, 360, 255, cv::FILLED);
  }
};

void BoundaryF_720p(benchmark::State& state) {
  const Masks masks;
  for (auto _ : state) benchmark::DoNotOptimize(BoundaryF(masks.a, masks.b));
}
BENCHMARK(BoundaryF_720p)->Unit(benchmark::kMillisecond);

// What it needs over the whole picture: two outlines and the distances from each.
void BoundaryF_720p_BaselineWholePicture(benchmark::State& state) {
  const Masks masks;
  cv::Mat core, distance;
  for (auto _ : state) {
    for (const cv::Mat& mask : {masks.a, masks.b}) {
      cv::erode(mask, core, cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}));
      cv::distanceTransform(~(mask & ~core), distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
      benchmark::DoNotOptimize(distance.data);
    }
  }
}
BENCHMARK(BoundaryF_720p_BaselineWholePicture)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mpc
