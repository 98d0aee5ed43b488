#include "camera_turns.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <opencv2/core/eigen.hpp>

#include "mpc/seg/background_motion.h"

namespace mpc::internal {
namespace {

constexpr double kPersonMargin = 0.15;  // around the joints, of the box's longer side
// Of the picture's longer side.
constexpr double kLeastShift = 0.003;     // of a background that is somewhere else
constexpr double kFarShift = 0.06;        // of a background that is compared with a nearer frame's
constexpr double kMostDistortion = 0.03;  // of a turn: where the corners lie

Eigen::Matrix3d Intrinsics(const Camera& camera) {
  Eigen::Matrix3d k;
  k << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  return k;
}

double LongerSide(const cv::Size& size) { return std::max(size.width, size.height); }

// How far the middle of the picture moves.
double Shift(const cv::Matx33d& motion, const cv::Size& size) {
  const cv::Vec3d middle((size.width - 1) / 2.0, (size.height - 1) / 2.0, 1);
  const cv::Vec3d moved = motion * middle;
  return std::hypot(moved[0] / moved[2] - middle[0], moved[1] / moved[2] - middle[1]);
}

}  // namespace

cv::Mat PersonBox(const Detections2d::Frame& person, const cv::Size& size) {
  Eigen::Array2d low = Eigen::Array2d::Constant(1e9), high = -low;
  for (Eigen::Index j = 0; j < person.confidence.size(); ++j) {
    if (!(person.confidence[j] > 0) || !person.pixels.col(j).allFinite()) continue;
    low = low.min(person.pixels.col(j).array());
    high = high.max(person.pixels.col(j).array());
  }
  cv::Mat box(size, CV_8U, cv::Scalar(0));
  if (!(low <= high).all()) return box;
  const double margin = kPersonMargin * (high - low).maxCoeff();
  const Eigen::Array2d last(size.width, size.height);
  low = (low - margin).max(0).min(last).floor();
  high = (high + margin).max(0).min(last).ceil();
  box(cv::Rect(cv::Point2d(low.x(), low.y()), cv::Point2d(high.x(), high.y()))).setTo(255);
  return box;
}

Eigen::Matrix3d HomographyOfTurn(const Eigen::Matrix3d& turn, const Camera& camera) {
  const Eigen::Matrix3d k = Intrinsics(camera);
  return k * turn * k.inverse();
}

std::optional<Eigen::Matrix3d> TurnOfHomography(const cv::Matx33d& homography,
                                                const Camera& camera) {
  const Eigen::Matrix3d k = Intrinsics(camera);
  Eigen::Matrix3d h;
  cv::cv2eigen(homography, h);
  const Eigen::Matrix3d motion = k.inverse() * h * k;
  if (!(motion.determinant() > 0)) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(motion, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
  const Eigen::Matrix3d turned = HomographyOfTurn(turn, camera);
  const double most = kMostDistortion * LongerSide({camera.width, camera.height});
  for (const double x : {0.0, camera.width - 1.0}) {
    for (const double y : {0.0, camera.height - 1.0}) {
      const Eigen::Vector3d corner(x, y, 1);
      const Eigen::Vector3d as_turned = turned * corner;
      if (!(as_turned.z() > 0)) return std::nullopt;
      if (!((as_turned.hnormalized() - (h * corner).hnormalized()).norm() < most)) {
        return std::nullopt;
      }
    }
  }
  return turn;
}

bool CameraRests(std::span<const cv::Mat> pictures, std::span<const int> frames,
                 const Detections2d& detections) {
  size_t num_still = 0;
  for (size_t i = 1; i < pictures.size(); ++i) {
    const cv::Size size = pictures[i].size();
    const std::optional<cv::Matx33d> motion = EstimateBackgroundMotion(
        pictures[i - 1], pictures[i],
        PersonBox(detections.frames[static_cast<size_t>(frames[i])], size));
    num_still += motion && Shift(*motion, size) < kLeastShift * LongerSide(size);
  }
  return 2 * num_still + 1 >= pictures.size();
}

std::optional<TurningCamera> FollowCamera(VideoReader video, const Camera& camera,
                                          const Detections2d& detections,
                                          const ProgressCallback& progress) {
  const auto num_frames = static_cast<int>(detections.frames.size());
  TurningCamera result;
  // What pictures are compared with, until they see little of the same background.
  std::optional<BackgroundPoints> key;
  int key_frame = 0;
  cv::Mat picture, before;
  const auto turn_to = [&](const cv::Mat& other) -> std::optional<CameraFromWorld> {
    const std::optional<cv::Matx33d> motion = key->MotionTo(other);
    const double far = kFarShift * LongerSide(other.size());
    if (!motion || Shift(*motion, other.size()) > far) return std::nullopt;
    const std::optional<Eigen::Matrix3d> turn = TurnOfHomography(*motion, camera);
    if (!turn) return std::nullopt;
    return CameraFromWorld{
        .rotation = *turn * result.places[static_cast<size_t>(key_frame)].rotation,
        .translation = Eigen::Vector3d::Zero()};
  };
  const auto set_key = [&](const cv::Mat& at, int f) {
    key.emplace(at, PersonBox(detections.frames[static_cast<size_t>(f)], at.size()));
    key_frame = f;
  };
  for (int f = 0; f < num_frames && video.Read(&picture); ++f) {
    if (f == 0) {
      result.places.emplace_back();
      set_key(picture, 0);
    } else {
      std::optional<CameraFromWorld> place = turn_to(picture);
      if (!place && key_frame != f - 1) {
        set_key(before, f - 1);
        place = turn_to(picture);
      }
      result.num_unseen += place ? 0 : 1;
      result.places.push_back(place.value_or(result.places.back()));
    }
    const double turned = Eigen::AngleAxisd(result.places.back().rotation).angle();
    result.largest_rad = std::max(result.largest_rad, turned);
    std::swap(before, picture);
    if (progress && !progress({"camera", f + 1, num_frames})) return std::nullopt;
  }
  return result;
}

}  // namespace mpc::internal
