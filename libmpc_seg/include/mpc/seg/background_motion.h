// Purpose: how the background moved between two pictures, for moving cameras.
// Source: Lucas-Kanade tracks and RANSAC (OpenCV).
// Frames: pictures, pixel centres at integers. Units: pixels.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace mpc {

// Points of a picture's background that can be found again in other pictures of it.
class BackgroundPoints {
 public:
  // Outside of `exclude` (CV_8U, nonzero: do not look; empty: look everywhere). Pictures as for
  // ExtractSilhouette. Throws Error as that does.
  BackgroundPoints(const cv::Mat& picture, const cv::Mat& exclude);

  // The homography that takes its picture's pixels to where the same background is in `other`, a picture of
  // the same size. The exact identity when it stood still as far as can be told; nullopt when there is too
  // little texture or no common motion. Deterministic and thread-safe.
  std::optional<cv::Matx33d> MotionTo(const cv::Mat& other) const;

 private:
  cv::Size size_;
  int num_halvings_ = 0;  // of the pictures that are compared
  cv::Mat grey_;
  std::vector<cv::Point2f> points_;
};

// The homography that takes pixels of `current` to where the same background was in `previous`,
// from what lies outside `exclude`: BackgroundPoints(current, exclude).MotionTo(previous).
std::optional<cv::Matx33d> EstimateBackgroundMotion(const cv::Mat& previous, const cv::Mat& current,
                                                    const cv::Mat& exclude);

}  // namespace mpc
