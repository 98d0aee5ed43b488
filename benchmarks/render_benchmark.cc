// Speed of the rasteriser, the silhouette, the boundary and the overlay: a closed surface of 14,000
// vertices that covers as much of a 1080p picture as a standing person. Baselines:
// cv::fillConvexPoly for masks; for depth and ids the textbook rasteriser, every pixel of every
// bounding box tested by three edge functions in floating point, no crop.
#include <benchmark/benchmark.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/render/boundary.h"
#include "mpc/render/draw.h"
#include "mpc/render/model_mask.h"
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
BENCHMARK(BM_RasterizeTextbook)->Unit(benchmark::kMicrosecond);

// Everything below draws into the person's part of the picture, as the product does.
struct Crop {
  Crop() {
    const Scene& s = Person();
    camera = mpc::CroppedTo(s.camera, mpc::ProjectedBounds(s.camera, s.positions));
    topology = mpc::SurfaceTopology::FromMesh({s.positions, s.triangles});
  }
  mpc::Camera camera;
  mpc::SurfaceTopology topology;
};

const Crop& PersonCrop() {
  static const Crop crop;
  return crop;
}

std::vector<Eigen::Vector2d> ProjectAll() {
  const Scene& s = Person();
  std::vector<Eigen::Vector2d> pixels(static_cast<size_t>(s.positions.cols()));
  for (Eigen::Index i = 0; i < s.positions.cols(); ++i) {
    mpc::Project(PersonCrop().camera, s.positions.col(i).cast<double>(),
                 &pixels[static_cast<size_t>(i)]);
  }
  return pixels;
}

// What both baseline and product need; the product's figures below contain it, the baseline's not.
void BM_ProjectVertices(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(ProjectAll());
}
BENCHMARK(BM_ProjectVertices)->Unit(benchmark::kMicrosecond);

// Baseline: OpenCV's polygon filler, triangle after triangle, from projected vertices.
void BM_FillConvexPoly(benchmark::State& state) {
  constexpr int kShift = 8;
  const Scene& s = Person();
  std::vector<cv::Point> points;
  for (const Eigen::Vector2d& p : ProjectAll()) {
    points.emplace_back(cvRound(p.x() * (1 << kShift)), cvRound(p.y() * (1 << kShift)));
  }
  cv::Mat mask(PersonCrop().camera.height, PersonCrop().camera.width, CV_8UC1);
  for (auto _ : state) {
    mask.setTo(0);
    for (Eigen::Index t = 0; t < s.triangles.cols(); ++t) {
      cv::Point corners[3];
      for (int i = 0; i < 3; ++i) corners[i] = points[static_cast<size_t>(s.triangles(i, t))];
      cv::fillConvexPoly(mask, corners, 3, cv::Scalar(255), cv::LINE_8, kShift);
    }
  }
}
BENCHMARK(BM_FillConvexPoly)->Unit(benchmark::kMicrosecond);

void BM_ModelMask(benchmark::State& state) {
  cv::Mat mask;
  for (auto _ : state) {
    mpc::ModelMask(PersonCrop().camera, Person().positions, PersonCrop().topology, &mask);
  }
}
BENCHMARK(BM_ModelMask)->Unit(benchmark::kMicrosecond);

// Mask, depth and triangle id: the plain kernel and the one for this machine.
void BM_RasterizeMeshScalar(benchmark::State& state) {
  mpc::RasterBuffers buffers;
  for (auto _ : state) {
    mpc::RasterizeMeshScalar(PersonCrop().camera, Person().positions, Person().triangles, {},
                             &buffers);
  }
}
BENCHMARK(BM_RasterizeMeshScalar)->Unit(benchmark::kMicrosecond);

void BM_RasterizeMesh(benchmark::State& state) {
  mpc::RasterBuffers buffers;
  for (auto _ : state) {
    mpc::RasterizeMesh(PersonCrop().camera, Person().positions, Person().triangles, {}, &buffers);
  }
}
BENCHMARK(BM_RasterizeMesh)->Unit(benchmark::kMicrosecond);

void BM_FindModelBoundary(benchmark::State& state) {
  const Crop& crop = PersonCrop();
  mpc::RasterBuffers buffers;
  cv::Mat mask;
  mpc::RasterizeMesh(crop.camera, Person().positions, Person().triangles, {}, &buffers);
  mpc::ModelMask(crop.camera, Person().positions, crop.topology, &mask);
  for (auto _ : state) {
    benchmark::DoNotOptimize(mpc::FindModelBoundary(crop.camera, Person().positions, crop.topology,
                                                    mask, buffers.depth));
  }
}
BENCHMARK(BM_FindModelBoundary)->Unit(benchmark::kMicrosecond);

// Mask, hidden parts and boundary of a posed mesh, as every iteration of a refinement needs them.
void BM_DrawModelBoundary(benchmark::State& state) {
  const Crop& crop = PersonCrop();
  mpc::BoundaryBuffers buffers;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        mpc::DrawModelBoundary(Person().camera, Person().positions, crop.topology, true, &buffers));
  }
}
BENCHMARK(BM_DrawModelBoundary)->Unit(benchmark::kMicrosecond);

// The same from whole images of mask and depth.
void BM_DrawModelBoundary_BaselineImages(benchmark::State& state) {
  const Crop& crop = PersonCrop();
  mpc::RasterBuffers buffers;
  cv::Mat mask;
  for (auto _ : state) {
    mpc::RasterizeMesh(crop.camera, Person().positions, Person().triangles, {}, &buffers);
    mpc::ModelMask(crop.camera, Person().positions, crop.topology, &mask);
    benchmark::DoNotOptimize(mpc::FindModelBoundary(crop.camera, Person().positions, crop.topology,
                                                    mask, buffers.depth));
  }
}
BENCHMARK(BM_DrawModelBoundary_BaselineImages)->Unit(benchmark::kMicrosecond);

// Sixteen limbs across the person: as outlines, and as the fine mesh whose depth is drawn too.
mpc::CapsuleSet Limbs() {
  mpc::CapsuleSet limbs;
  for (int i = 0; i < 16; ++i) {
    const double y = -0.8 + 0.1 * i;
    limbs.push_back({{-0.2, y, 4}, {0.2, y + 0.1, 4.1}, 0.06, 0.04});
  }
  return limbs;
}

void BM_SkeletonMask(benchmark::State& state) {
  cv::Mat mask;
  mpc::ModelMask(PersonCrop().camera, Person().positions, PersonCrop().topology, &mask);
  for (auto _ : state) {
    benchmark::DoNotOptimize(mpc::SkeletonMask(PersonCrop().camera, Limbs(), 1.0 / 3, mask));
  }
}
BENCHMARK(BM_SkeletonMask)->Unit(benchmark::kMicrosecond);

void BM_RasterizeCapsules(benchmark::State& state) {
  mpc::RasterBuffers buffers;
  for (auto _ : state) mpc::RasterizeCapsules(PersonCrop().camera, Limbs(), {}, &buffers);
}
BENCHMARK(BM_RasterizeCapsules)->Unit(benchmark::kMicrosecond);

void BM_DrawMeshOverlay(benchmark::State& state) {
  const Scene& s = Person();
  cv::Mat frame(s.camera.height, s.camera.width, CV_8UC3, cv::Scalar(90, 90, 90));
  for (auto _ : state) mpc::DrawMeshOverlay(s.camera, s.positions, s.triangles, &frame);
}
BENCHMARK(BM_DrawMeshOverlay)->Unit(benchmark::kMicrosecond);

}  // namespace
