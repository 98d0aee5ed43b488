// Speed of the rasteriser and of the overlay: a closed surface of 14,000 vertices that covers as
// much of a 1080p picture as a standing person. Baseline: the textbook rasteriser, every pixel of
// every bounding box tested by three edge functions in floating point, no crop.
#include <benchmark/benchmark.h>

#include <cmath>

#include "mpc/render/draw.h"
#include "mpc/render/raster.h"

namespace {

struct Scene {
  mpc::Camera camera = mpc::Camera::FromFov(1920, 1080, 1.2);
  Eigen::Matrix3Xf positions;
  mpc::Triangles triangles;
};

// An ellipsoid of a person's size, 4 m away.
const Scene& Person() {
  static const Scene scene = [] {
    Scene s;
    const int rings = 100, sides = 140;
    s.positions.resize(3, rings * sides);
    s.triangles.resize(3, 2 * (rings - 1) * sides);
    int t = 0;
    for (int r = 0; r < rings; ++r) {
      const double polar = M_PI * (r + 0.5) / rings;
      for (int i = 0; i < sides; ++i) {
        const double around = 2 * M_PI * i / sides;
        s.positions.col(r * sides + i) =
            Eigen::Vector3d(0.3 * std::sin(polar) * std::cos(around), -0.9 * std::cos(polar),
                            4 + 0.2 * std::sin(polar) * std::sin(around))
                .cast<float>();
        if (r + 1 == rings) continue;
        const int here = r * sides + i, next = r * sides + (i + 1) % sides;
        s.triangles.col(t++) << here, next, here + sides;
        s.triangles.col(t++) << next, next + sides, here + sides;
      }
    }
    return s;
  }();
  return scene;
}

void Textbook(const Scene& s, cv::Mat* depth, cv::Mat* ids) {
  depth->create(s.camera.height, s.camera.width, CV_32F);
  ids->create(s.camera.height, s.camera.width, CV_32S);
  depth->setTo(0);
  ids->setTo(-1);
  for (int t = 0; t < s.triangles.cols(); ++t) {
    Eigen::Matrix<double, 3, 3> x;
    Eigen::Matrix<double, 2, 3> p;
    for (int i = 0; i < 3; ++i) {
      x.col(i) = s.positions.col(s.triangles(i, t)).cast<double>();
      Eigen::Vector2d pixel;
      mpc::Project(s.camera, x.col(i), &pixel);
      p.col(i) = pixel;
    }
    const auto cross = [&](int a, int b, const Eigen::Vector2d& q) {
      return (p(0, b) - p(0, a)) * (q.y() - p(1, a)) - (p(1, b) - p(1, a)) * (q.x() - p(0, a));
    };
    const double area = cross(0, 1, p.col(2));
    if (area == 0) continue;
    const Eigen::Vector2d least = p.rowwise().minCoeff(), most = p.rowwise().maxCoeff();
    for (int y = std::max(0, (int)least.y()); y <= std::min(s.camera.height - 1, (int)most.y());
         ++y) {
      for (int c = std::max(0, (int)least.x()); c <= std::min(s.camera.width - 1, (int)most.x());
           ++c) {
        const Eigen::Vector2d q(c, y);
        const Eigen::Vector3d w =
            Eigen::Vector3d(cross(1, 2, q), cross(2, 0, q), cross(0, 1, q)) / area;
        if (w.minCoeff() < 0) continue;
        const auto z = static_cast<float>(1 / (w.array() / x.row(2).transpose().array()).sum());
        if (ids->at<int>(y, c) >= 0 && z >= depth->at<float>(y, c)) continue;
        depth->at<float>(y, c) = z;
        ids->at<int>(y, c) = t;
      }
    }
  }
}

void BM_RasterizeTextbook(benchmark::State& state) {
  cv::Mat depth, ids;
  for (auto _ : state) Textbook(Person(), &depth, &ids);
}
BENCHMARK(BM_RasterizeTextbook)->Unit(benchmark::kMillisecond);

void BM_RasterizeMesh(benchmark::State& state) {
  const Scene& s = Person();
  mpc::RasterBuffers buffers;
  for (auto _ : state) mpc::RasterizeMesh(s.camera, s.positions, s.triangles, {}, &buffers);
}
BENCHMARK(BM_RasterizeMesh)->Unit(benchmark::kMillisecond);

void BM_MeshMask(benchmark::State& state) {
  const Scene& s = Person();
  for (auto _ : state) benchmark::DoNotOptimize(mpc::MeshMask(s.camera, s.positions, s.triangles));
}
BENCHMARK(BM_MeshMask)->Unit(benchmark::kMillisecond);

void BM_DrawMeshOverlay(benchmark::State& state) {
  const Scene& s = Person();
  cv::Mat frame(s.camera.height, s.camera.width, CV_8UC3, cv::Scalar(90, 90, 90));
  for (auto _ : state) mpc::DrawMeshOverlay(s.camera, s.positions, s.triangles, &frame);
}
BENCHMARK(BM_DrawMeshOverlay)->Unit(benchmark::kMillisecond);

}  // namespace
