// Purpose: how the background moved between two pictures, for moving cameras.
// Source: Lucas-Kanade tracks and RANSAC (OpenCV).
// Frames: pictures, pixel centres at integers. Units: pixels.
#pragma once

#include <opencv2/core.hpp>
#include <optional>

namespace mpc {

// The homography that takes pixels of `current` to where the same background was in `previous`,
// from what lies outside `exclude` (CV_8U, nonzero: do not look; empty: look everywhere). The exact
// identity when it stood still as far as can be told; nullopt when there is too little
// texture or no common motion. Pictures as for ExtractSilhouette, of equal sizes.
// Deterministic and thread-safe.
std::optional<cv::Matx33d> EstimateBackgroundMotion(const cv::Mat& previous, const cv::Mat& current,
                                                    const cv::Mat& exclude);

}  // namespace mpc
