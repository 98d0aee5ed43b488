#include "mpc/detect/pose_landmarker.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/dnn.hpp>
#include <utility>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr int kLandmarkInput = 256;
constexpr int kNumPoints = 39;  // the landmarks, then the region's two points, then unused ones
constexpr int kHipsPoint = 33;
constexpr int kReachPoint = 34;
constexpr int kHeatmapSize = 64;
constexpr int kRefineRadius = 3;  // cells
constexpr float kMinHeatmapScore = 0.5f;

// What the network says about one square; points are shares of its side.
struct SquarePose {
  Eigen::Matrix<double, 2, kNumPoints> points;
  Eigen::Matrix<double, 3, kNumBlazePoseLandmarks> world;
  Eigen::Vector<double, kNumBlazePoseLandmarks> visibility;
  Eigen::Vector<double, kNumBlazePoseLandmarks> presence;
  double score = 0;
  cv::Mat mask;
};

float Sigmoid(float x) { return 1 / (1 + std::exp(-x)); }

// One channel of the heatmap, in either order of axes.
class Heatmap {
 public:
  explicit Heatmap(const cv::Mat& output)
      : data_(output.ptr<float>()), channels_first_(output.size[1] == kNumPoints) {}
  float Score(int channel, int row, int column) const {
    const int cell = row * kHeatmapSize + column;
    return Sigmoid(channels_first_ ? data_[channel * kHeatmapSize * kHeatmapSize + cell]
                                   : data_[cell * kNumPoints + channel]);
  }

 private:
  const float* data_;
  bool channels_first_;
};

// Moves a point to the heatmap's centre of mass around it, where the heatmap is sure enough.
void Refine(const Heatmap& heatmap, int channel, Eigen::Ref<Eigen::Vector2d> point) {
  if (!(point.minCoeff() >= 0 && point.maxCoeff() < 1)) return;
  const int column = static_cast<int>(point.x() * kHeatmapSize);
  const int row = static_cast<int>(point.y() * kHeatmapSize);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0;
  float best = 0;
  for (int r = std::max(0, row - kRefineRadius);
       r <= std::min(kHeatmapSize - 1, row + kRefineRadius); ++r) {
    for (int c = std::max(0, column - kRefineRadius);
         c <= std::min(kHeatmapSize - 1, column + kRefineRadius); ++c) {
      const float score = heatmap.Score(channel, r, c);
      best = std::max(best, score);
      weight += score;
      sum += score * Eigen::Vector2d(c, r);
    }
  }
  if (best >= kMinHeatmapScore) point = sum / weight / kHeatmapSize;
}

SquarePose Decode(const std::vector<cv::Mat>& outputs, const std::string& name) {
  cv::Mat points, score, mask, heatmap, world;
  for (const cv::Mat& output : outputs) {
    const auto total = static_cast<int>(output.total());
    if (total == 5 * kNumPoints) points = output;
    if (total == 1) score = output;
    if (total == kLandmarkInput * kLandmarkInput) mask = output;
    if (total == kHeatmapSize * kHeatmapSize * kNumPoints && output.dims == 4) heatmap = output;
    if (total == 3 * kNumPoints) world = output;
  }
  if (points.empty() || score.empty() || mask.empty() || heatmap.empty() || world.empty()) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{} is no network for body landmarks: it has not their outputs", name));
  }
  SquarePose pose;
  pose.score = std::clamp(double{*score.ptr<float>()}, 0.0, 1.0);
  const Heatmap scores(heatmap);
  for (int i = 0; i < kNumPoints; ++i) {
    const float* const point = points.ptr<float>() + 5 * i;
    pose.points.col(i) = Eigen::Vector2d(point[0], point[1]) / kLandmarkInput;
    Refine(scores, i, pose.points.col(i));
    if (i >= kNumBlazePoseLandmarks) continue;
    pose.visibility[i] = Sigmoid(point[3]);
    pose.presence[i] = Sigmoid(point[4]);
    const float* const in_world = world.ptr<float>() + 3 * i;
    pose.world.col(i) << in_world[0], in_world[1], in_world[2];
  }
  pose.mask.create(kLandmarkInput, kLandmarkInput, CV_32F);
  std::transform(mask.ptr<float>(), mask.ptr<float>() + mask.total(), pose.mask.ptr<float>(),
                 Sigmoid);
  return pose;
}

int MirrorLandmark(int i) {
  if (i == 0) return 0;  // the nose
  if (i >= 1 && i <= 6) return i <= 3 ? i + 3 : i - 3;
  return i % 2 == 1 ? i + 1 : i - 1;
}

// What the network says about the mirrored square, mirrored back.
SquarePose Mirrored(const SquarePose& in) {
  SquarePose out = in;
  for (int i = 0; i < kNumBlazePoseLandmarks; ++i) {
    const int m = MirrorLandmark(i);
    out.points.col(i) = in.points.col(m);
    out.world.col(i) = in.world.col(m);
    out.visibility[i] = in.visibility[m];
    out.presence[i] = in.presence[m];
  }
  out.points.row(0) = 1 - out.points.row(0).array();
  out.world.row(0) *= -1;
  cv::flip(in.mask, out.mask, 1);
  return out;
}

SquarePose Mean(const SquarePose& a, const SquarePose& b) {
  SquarePose mean;
  mean.points = (a.points + b.points) / 2;
  mean.world = (a.world + b.world) / 2;
  mean.visibility = (a.visibility + b.visibility) / 2;
  mean.presence = (a.presence + b.presence) / 2;
  mean.score = (a.score + b.score) / 2;
  mean.mask = (a.mask + b.mask) / 2;
  return mean;
}

}  // namespace

Eigen::Vector<double, kNumBlazePoseLandmarks> PersonPose::Confidences() const {
  return visibility.cwiseProduct(presence);
}

PoseLandmarker::PoseLandmarker(Network network, PoseLandmarkerOptions options)
    : network_(std::move(network)), options_(options) {
  if (network_.input_width() != 0 &&
      (network_.input_width() != kLandmarkInput || network_.input_height() != kLandmarkInput)) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{} takes pictures of {}x{}, a network for body landmarks {}x{}",
                            network_.name(), network_.input_width(), network_.input_height(),
                            kLandmarkInput, kLandmarkInput));
  }
}

PersonPose PoseLandmarker::Find(const cv::Mat& bgr, const PersonRegion& region) {
  const auto look = [&](const cv::Mat& square) {
    const cv::Mat blob = cv::dnn::blobFromImage(square, 1 / 255.0, {}, {}, /*swapRB=*/true);
    return Decode(network_.Run(blob), network_.name());
  };
  cv::Mat square = CropRegion(bgr, region, kLandmarkInput);
  SquarePose found = look(square);
  if (options_.average_mirrored) {
    cv::flip(square, square, 1);
    found = Mean(found, Mirrored(look(square)));
  }
  PersonPose pose;
  for (int i = 0; i < kNumBlazePoseLandmarks; ++i) {
    pose.pixels.col(i) = region.PixelAt(found.points.col(i));
  }
  pose.world = found.world;
  pose.world.topRows<2>() =
      Eigen::Rotation2Dd(region.rotation_rad).toRotationMatrix() * found.world.topRows<2>();
  pose.visibility = found.visibility;
  pose.presence = found.presence;
  pose.score = found.score;
  pose.region = region;
  pose.refined = PersonRegion::Around(region.PixelAt(found.points.col(kHipsPoint)),
                                      region.PixelAt(found.points.col(kReachPoint)));
  pose.mask = found.mask;
  return pose;
}

}  // namespace mpc
