// Purpose: the body landmarks, their 3D positions and the mask of the one person in a region.
// Source: MediaPipe BlazePose (Bazarevsky et al. 2020; Grishchenko et al. 2022); docs/detect.md.
// Frames: 3D in the ray frame (docs/conventions.md), origin at mid-hip. Units: pixels, metres.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "mpc/core/blazepose.h"
#include "mpc/detect/network.h"
#include "mpc/detect/person_region.h"

namespace mpc {

struct PersonPose {
  Eigen::Matrix<double, 2, kNumBlazePoseLandmarks> pixels;
  Eigen::Matrix<double, 3, kNumBlazePoseLandmarks> world;
  Eigen::Vector<double, kNumBlazePoseLandmarks> visibility;  // in [0, 1]: not hidden
  Eigen::Vector<double, kNumBlazePoseLandmarks> presence;    // in [0, 1]: inside of the picture
  double score = 0;                                          // in [0, 1]: there is a person
  PersonRegion region;                                       // that was looked at
  PersonRegion refined;  // around the person that was found: where to look next
  cv::Mat mask;          // CV_32F: probability of the person, for each pixel of the region's square

  // visibility * presence.
  Eigen::Vector<double, kNumBlazePoseLandmarks> Confidences() const;
};

struct PoseLandmarkerOptions {
  // Look at the mirrored region too and take the mean: better, at twice the time.
  bool average_mirrored = false;
};

// Not thread-safe.
class PoseLandmarker {
 public:
  // Throws Error (kUnsupported) for a network without this one's outputs.
  explicit PoseLandmarker(Network network, PoseLandmarkerOptions options = {});

  // The person in the region of a picture (CV_8UC3). Always gives some pose: see its score.
  PersonPose Find(const cv::Mat& bgr, const PersonRegion& region);

 private:
  Network network_;
  PoseLandmarkerOptions options_;
};

}  // namespace mpc
