// Purpose: follows people through a clip: the same person keeps the same number.
// Source: MediaPipe's pose tracking (the landmarks of a frame say where to look in the next one);
// searching for who was lost and keeping people apart are ours (docs/detect.md).
// Units: frames, seconds, pixels.
#pragma once

#include <optional>
#include <vector>

#include "mpc/detect/person_detector.h"
#include "mpc/detect/pose_landmarker.h"

namespace mpc {

struct PoseTrackerOptions {
  int max_persons = 3;      // followed at a time, each costs a run of the network; ours
  double search_s = 0.5;    // between looks at the whole picture for new people; ours
  double search_far_s = 2;  // between looks for small ones; with nobody in view: always; ours
  double give_up_s = 1.5;   // after which a lost person is searched no longer; ours
};

struct TrackedPerson {
  int id = 0;
  PersonPose pose;
};

// Not thread-safe.
class PoseTracker {
 public:
  PoseTracker(PersonDetector detector, PoseLandmarker landmarker, double fps,
              PoseTrackerOptions options = {});

  // The people in a picture (CV_8UC3). Frame numbers rise from call to call; frames may be left
  // out. Who is not seen in this frame is not in the result and may come back in a later one.
  std::vector<TrackedPerson> Next(const cv::Mat& bgr, int frame);

  // The person who is expected in this region of a picture of any frame, or nobody. Changes nothing
  // about who is followed.
  std::optional<PersonPose> FindExpected(const cv::Mat& bgr, const PersonRegion& expected);

 private:
  struct Track {
    int id = 0;
    PersonRegion region;                                 // where to look, as of frame `seen`
    Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  // of its centre, px per frame
    double turn_rad = 0;                                 // of the region, per frame
    int seen = 0;                                        // the last frame with this person
    cv::Mat colours;                                     // histogram of the person's pixels
    std::optional<PersonPose> pose;                      // in the current frame
    PersonRegion predicted;                              // for the current frame
  };

  bool IsTaken(const PersonRegion& region) const;
  Track* MostSimilar(const cv::Mat& colours);
  std::optional<PersonPose> Verify(const cv::Mat& bgr, const PersonRegion& region,
                                   double min_visibility);
  void Separate();
  void SearchLost(const cv::Mat& bgr, Track* track);
  void SearchNew(const cv::Mat& bgr, bool everywhere);
  void Accept(const cv::Mat& bgr, int frame, Track* track);

  PersonDetector detector_;
  PoseLandmarker landmarker_;
  double fps_;
  PoseTrackerOptions options_;
  std::vector<Track> tracks_;
  int frame_ = -1;
  int next_search_ = 0;
  int next_far_search_ = 0;
  int next_id_ = 0;
};

}  // namespace mpc
