#include "background_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <opencv2/core/eigen.hpp>
#include <span>
#include <utility>

#include "camera_turns.h"
#include "clip_reader.h"
#include "mpc/seg/background_motion.h"
#include "silhouette_maker.h"

namespace mpc::internal {
namespace {

constexpr double kMaxPlateSides = 2;  // of the picture's
constexpr double kMinDepth = 0.3;     // cosine of the most that a ray turns to the plate

// The plate of a camera that turns, and where the frames see it; nowhere, if they look too far aside.
struct TurningPlate {
  cv::Size size;
  std::vector<std::optional<cv::Matx33d>> plate_from_picture;
};

TurningPlate PlaceTurningPlate(const Camera& camera, std::span<const CameraFromWorld> motion) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const CameraFromWorld& frame : motion) sum += frame.rotation;
  const auto nearness = [&](const CameraFromWorld& frame) {
    return frame.rotation.cwiseProduct(sum).sum();
  };
  const Eigen::Matrix3d middle =
      std::max_element(motion.begin(), motion.end(), [&](const auto& a, const auto& b) {
        return nearness(a) < nearness(b);
      })->rotation;
  std::vector<std::optional<Eigen::Matrix3d>> turns;
  Eigen::Array2d low(0, 0), high(camera.width - 1, camera.height - 1);
  for (const CameraFromWorld& frame : motion) {
    const Eigen::Matrix3d turn = HomographyOfTurn(middle * frame.rotation.transpose(), camera);
    Eigen::Matrix<double, 3, 4> corners;
    corners << 0, camera.width - 1, 0, camera.width - 1,  //
        0, 0, camera.height - 1, camera.height - 1, 1, 1, 1, 1;
    corners = turn * corners;
    turns.emplace_back();
    if (corners.row(2).minCoeff() < kMinDepth) continue;
    turns.back() = turn;
    const Eigen::Matrix<double, 2, 4> seen = corners.colwise().hnormalized();
    low = low.min(seen.rowwise().minCoeff().array());
    high = high.max(seen.rowwise().maxCoeff().array());
  }
  const Eigen::Array2d picture(camera.width, camera.height);
  const Eigen::Array2d most = 0.5 * (kMaxPlateSides - 1) * picture;
  low = low.max(-most).floor();
  high = high.min(picture - 1 + most).ceil();

  TurningPlate plate;
  plate.size = {static_cast<int>(high.x() - low.x()) + 1, static_cast<int>(high.y() - low.y()) + 1};
  const cv::Matx33d shift(1, 0, -low.x(), 0, 1, -low.y(), 0, 0, 1);
  for (const std::optional<Eigen::Matrix3d>& turn : turns) {
    plate.plate_from_picture.emplace_back();
    if (!turn) continue;
    cv::Matx33d h;
    cv::eigen2cv(*turn, h);
    plate.plate_from_picture.back() = shift * h;
  }
  return plate;
}

// Whether the background of each picture is where it is in the one before.
bool Rests(std::span<const PlateSample> samples) {
  for (size_t i = 1; i < samples.size(); ++i) {
    const std::optional<cv::Matx33d> motion =
        EstimateBackgroundMotion(samples[i - 1].picture, samples[i].picture, samples[i].model_mask);
    if (!motion || *motion != cv::Matx33d::eye()) return false;
  }
  return true;
}

}  // namespace

std::optional<BackgroundView> BackgroundView::See(const PosedClip& clip, const ClipView& view,
                                                  const SilhouetteOptions& options,
                                                  const char* stage,
                                                  const ProgressCallback& progress) {
  BackgroundView seen;
  std::vector<cv::Mat> kept;
  if (clip.background != nullptr) kept.swap(*clip.background);
  if (!clip.masks.empty() || options.segmentation.weight_plate == 0) return seen;
  const SurfaceTopology topology = SurfaceTopology::FromMesh(clip.character.mesh);
  const auto num_frames = static_cast<int>(clip.poses.cols());
  const bool turns = static_cast<int>(clip.camera_motion.size()) == num_frames && num_frames > 0;
  TurningPlate place;
  if (turns) place = PlaceTurningPlate(view.camera, clip.camera_motion);
  const std::vector<int> frames = BackgroundFrames(num_frames);
  std::optional<VideoReader> video;
  if (kept.size() != frames.size()) video = OpenVideo(clip);
  std::vector<PlateSample> samples;
  for (size_t i = 0; i < frames.size(); ++i) {
    const int f = frames[i];
    cv::Mat picture;
    if (video) {
      while (video->frame_index() < f - 1 && video->Skip()) {
      }
      if (!video->Read(&picture)) break;
    } else {
      picture = std::move(kept[i]);
    }
    if (progress && !progress({stage, 0, num_frames})) return std::nullopt;
    if (turns && !place.plate_from_picture[static_cast<size_t>(f)]) continue;
    samples.push_back({view.Look(picture),
                       PosedModelMask(clip.character, view.camera, topology, clip.poses.col(f))});
    if (turns) {
      samples.back().plate_from_picture = place.plate_from_picture[static_cast<size_t>(f)];
    }
  }
  if (samples.empty()) return seen;
  seen.rests_ = !turns && Rests(samples);
  seen.plate_ = MakeBackgroundPlate(samples, options.num_threads, place.size);
  seen.picture_size_ = {view.camera.width, view.camera.height};
  seen.plate_from_picture_ = std::move(place.plate_from_picture);
  return seen;
}

BackgroundPlate BackgroundView::At(int frame) const {
  if (plate_.empty() || plate_from_picture_.empty()) return plate_;
  const std::optional<cv::Matx33d>& place = plate_from_picture_[static_cast<size_t>(frame)];
  return place ? ViewOfPlate(plate_, *place, picture_size_) : BackgroundPlate();
}

}  // namespace mpc::internal
