// Purpose: 2D and 3D joints of one person through a clip, from its pictures.
// Source: MediaPipe BlazePose; how often it looks and how it fills in between is ours
// (docs/detect.md). Units: pixels, metres, seconds.
#pragma once

#include <Eigen/Core>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "mpc/core/detections.h"
#include "mpc/detect/models.h"
#include "mpc/detect/person_mask.h"
#include "mpc/detect/pose_tracker.h"

namespace mpc {

struct ClipDetectorOptions {
  // Of several people: the rank-th largest over the clip (1: the largest), or who is at `at`
  // (px) in the first frame that shows anybody.
  int person = 1;
  std::optional<Eigen::Vector2d> at;
  // The networks look at every n-th frame, and at the last; 0: as rarely as motion up to cutoff_hz
  // allows. In between a cubic goes through the joints.
  int every = 0;
  double cutoff_hz = 6;  // as PoseOptions::cutoff_hz
  PoseLandmarkerOptions landmarker;
  PoseTrackerOptions tracker;

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

struct ClipDetections {
  Detections2d detections2d;      // F frames
  Detections3d detections3d;      // F frames, ray-aligned
  std::vector<PersonMask> masks;  // of the looks that show the person, 16 kB each
  int every = 1;                  // frames from one look to the next
  int num_looks = 0;              // frames that were looked at,
  int num_seen = 0;               // and those of them that show the person
  int num_persons = 0;            // in the clip
};

// Frames between two looks that keep motion up to cutoff_hz, at least 1.
int DetectionStride(double fps, double cutoff_hz);

// Takes a clip frame by frame; of its pictures only small masks are kept. Not thread-safe.
class ClipDetector {
 public:
  // Throws Error: kInvalidArgument, and as Network::Read for the models.
  ClipDetector(const PoseModels& models, int width, int height, double fps,
               ClipDetectorOptions options = {});

  // The next frame (CV_8UC3, width x height).
  void Add(const cv::Mat& bgr);

  // After the last frame. Throws Error (kMismatch) when the person that was asked for, or anybody,
  // is in no frame.
  ClipDetections Finish();

 private:
  // A person in a frame that was looked at.
  struct Sample {
    int frame = 0;
    PersonRegion region;  // around the person
    PersonMask mask;
    Detections2d::Frame joints2d;
    Detections3d::Frame joints3d;
  };

  void Look(const cv::Mat& bgr, int frame);
  const std::vector<Sample>& Choose() const;

  PoseTracker tracker_;
  ClipDetectorOptions options_;
  ClipDetections result_;
  std::map<int, std::vector<Sample>> samples_;  // by the person's number
  int num_frames_ = 0;
  cv::Mat last_;  // frame, when it was not looked at
};

}  // namespace mpc
