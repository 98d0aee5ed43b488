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
  // The networks look at every n-th frame, and at the last; 0: at every EvenDetectionStride-th, and
  // midway between two of these at who does not move evenly. In between a cubic goes through the
  // joints.
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
  int every = 1;                  // frames from one look to the next at most
  int num_looks = 0;              // frames in which the person was looked for,
  int num_seen = 0;               // and those of them that show it
  int num_persons = 0;            // in the clip
};

// Frames between two looks that keep motion up to cutoff_hz, at least 1.
int DetectionStride(double fps, double cutoff_hz);

// Frames between two looks that are enough while a person moves evenly: twice as many, where that is
// still a look per period of cutoff_hz, which shows that the motion is no longer even.
int EvenDetectionStride(double fps, double cutoff_hz);

// Takes a clip frame by frame; of its pictures small masks are kept, and the last two or three whole.
// Not thread-safe.
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

  struct Person {
    std::map<int, Sample> samples;  // by frame
    double size = 0;                // over the regular looks
    int num_between = 0;            // looks midway between two regular ones

    const Sample* Find(int frame) const;  // nullptr when not seen in it
  };

  static void AddSample(const PersonPose& pose, int frame, Person* person);
  static double Bend(const Sample& before, const Sample& at, const Sample& after);
  void Look(const cv::Mat& bgr, int frame);
  void LookBetween(size_t look);
  bool MovesEvenly(const Person& person, size_t look) const;
  Person& Choose();

  PoseTracker tracker_;
  ClipDetectorOptions options_;
  ClipDetections result_;
  int between_ = 0;                // frames from a regular look to the one midway to the next
  std::map<int, Person> persons_;  // by their numbers
  std::vector<int> looks_;         // frames that were looked at regularly
  std::map<int, cv::Mat> held_;    // by frame: pictures that may be looked at midway
  int num_frames_ = 0;
  cv::Mat last_;  // frame, when it was not looked at
};

}  // namespace mpc
