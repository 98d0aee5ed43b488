// Purpose: finds people in a picture.
// Source: MediaPipe's pose detector (single-shot detector with 2254 anchors); docs/detect.md.
// Units: pixels.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "mpc/detect/network.h"
#include "mpc/detect/person_region.h"

namespace mpc {

struct PersonCandidate {
  PersonRegion region;
  double score = 0;  // in [0, 1]
};

// Not thread-safe.
class PersonDetector {
 public:
  // Throws Error (kUnsupported) for a network without this detector's outputs.
  explicit PersonDetector(Network network);

  // People in a part of a picture (CV_8UC3), which may reach beyond its border: best first, one
  // candidate per person, all with scores of at least 0.5. A person should fill a sixth of the area
  // or more.
  std::vector<PersonCandidate> Find(const cv::Mat& bgr, const cv::Rect& area);

  // The same in the whole picture and in overlapping squares of it, for small people.
  std::vector<PersonCandidate> FindEverywhere(const cv::Mat& bgr);

 private:
  Network network_;
};

}  // namespace mpc
