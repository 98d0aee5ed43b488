#include "mpc/seg/background_motion.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <vector>

#include "mpc/core/error.h"
#include "picture.h"

namespace mpc {
namespace {

constexpr int kMaxSidePx = 640;  // larger pictures are tracked at half the size, a quarter, ...
constexpr int kMaxPoints = 200;
constexpr size_t kMinPoints = 16;
constexpr double kRansacPx = 1.0;    // at that size
constexpr double kMinInliers = 0.5;  // share of the tracks
constexpr double kStillPx = 0.1;     // mean of the tracks of a still background, at that size
constexpr double kScatterPx = 0.5;   // length of most of its tracks
constexpr double kMostTracks = 0.8;

cv::Mat SmallGrey(const cv::Mat& picture, int num_halvings) {
  cv::Mat grey;
  cv::cvtColor(ToBgr8(picture), grey, cv::COLOR_BGR2GRAY);
  for (int i = 0; i < num_halvings; ++i) grey = Halved(grey);
  return grey;
}

cv::Vec2d Apply(const cv::Matx33d& h, double x, double y) {
  const cv::Vec3d p = h * cv::Vec3d(x, y, 1);
  return {p[0] / p[2], p[1] / p[2]};
}

}  // namespace

BackgroundPoints::BackgroundPoints(const cv::Mat& picture, const cv::Mat& exclude)
    : size_(picture.size()) {
  CheckPicture(picture, "picture");
  if (!exclude.empty()) CheckMask(exclude, size_, "mask to exclude");
  while (std::max(size_.width, size_.height) >> num_halvings_ > kMaxSidePx &&
         std::min(size_.width, size_.height) >> num_halvings_ >= 2) {
    ++num_halvings_;
  }
  grey_ = SmallGrey(picture, num_halvings_);
  cv::Mat allowed;
  if (!exclude.empty()) {
    cv::resize(exclude, allowed, grey_.size(), 0, 0, cv::INTER_NEAREST);
    allowed = allowed == 0;
  }
  const double min_distance = std::max(2.0, 0.02 * grey_.cols);
  cv::goodFeaturesToTrack(grey_, points_, kMaxPoints, 0.01, min_distance, allowed);
}

std::optional<cv::Matx33d> BackgroundPoints::MotionTo(const cv::Mat& other) const {
  CheckPicture(other, "previous picture");
  if (other.size() != size_) {
    throw Error(ErrorCode::kMismatch, "segmentation: the previous picture has another size");
  }
  if (points_.size() < kMinPoints) return std::nullopt;
  std::vector<cv::Point2f> tracked;
  std::vector<uint8_t> found;
  cv::calcOpticalFlowPyrLK(grey_, SmallGrey(other, num_halvings_), points_, tracked, found,
                           cv::noArray(), {15, 15}, 4,
                           {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 10, 0.03});
  std::vector<cv::Point2f> from;
  std::vector<cv::Point2f> to;
  for (size_t i = 0; i < points_.size(); ++i) {
    if (!found[i]) continue;
    from.push_back(points_[i]);
    to.push_back(tracked[i]);
  }
  if (from.size() < kMinPoints) return std::nullopt;
  std::vector<uint8_t> inlier;
  const cv::Mat estimate = cv::findHomography(from, to, cv::RANSAC, kRansacPx, inlier, 500);
  const auto num_inliers = static_cast<size_t>(std::count(inlier.begin(), inlier.end(), 1));
  if (estimate.empty() || num_inliers < kMinPoints ||
      static_cast<double>(num_inliers) < kMinInliers * static_cast<double>(from.size())) {
    return std::nullopt;
  }

  // Tracks of a still background scatter around zero.
  cv::Point2f sum(0, 0);
  size_t num_still = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    if (!inlier[i]) continue;
    sum += to[i] - from[i];
    num_still += cv::norm(to[i] - from[i]) < kScatterPx;
  }
  if (cv::norm(sum) < kStillPx * static_cast<double>(num_inliers) &&
      static_cast<double>(num_still) > kMostTracks * static_cast<double>(num_inliers)) {
    return cv::Matx33d::eye();
  }

  // From the small pictures' pixels to the full ones': centres at integers, so (x + 1/2) scales.
  const double block = 1 << num_halvings_;
  const double centre = (block - 1) / 2;
  const cv::Matx33d full_from_small(block, 0, centre, 0, block, centre, 0, 0, 1);
  const cv::Matx33d h =
      full_from_small * cv::Matx33d(estimate.ptr<double>()) * full_from_small.inv();

  // A homography that folds or turns the picture is no motion between two frames of a video.
  const cv::Vec2d corners[] = {{0, 0},
                               {size_.width - 1.0, 0},
                               {0, size_.height - 1.0},
                               {size_.width - 1.0, size_.height - 1.0}};
  double largest = 0;
  for (const cv::Vec2d& corner : corners) {
    const double move = cv::norm(Apply(h, corner[0], corner[1]) - corner);
    if (!std::isfinite(move)) return std::nullopt;
    largest = std::max(largest, move);
  }
  if (largest > 0.25 * std::max(size_.width, size_.height)) return std::nullopt;
  return h;
}

std::optional<cv::Matx33d> EstimateBackgroundMotion(const cv::Mat& previous, const cv::Mat& current,
                                                    const cv::Mat& exclude) {
  return BackgroundPoints(current, exclude).MotionTo(previous);
}

}  // namespace mpc
