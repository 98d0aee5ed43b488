// The joints of the largest person in a video, frame by frame, from C++.
//
//   example_detect_person CLIP

#include <cstdio>

#include "mpc/core/error.h"
#include "mpc/detect/clip_detector.h"
#include "mpc/io/video.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    mpc::VideoReader video(argv[1]);
    mpc::ClipDetector detector(mpc::FindPoseModels(), video.width(), video.height(), video.fps());
    cv::Mat picture;
    while (video.Read(&picture)) detector.Add(picture);
    const mpc::ClipDetections found = detector.Finish();
    const int wrist = mpc::FindColumn(found.detections2d.joints, mpc::JointId::kLeftWrist);
    for (const mpc::Detections2d::Frame& frame : found.detections2d.frames) {
      std::printf("left wrist at %.1f, %.1f px, confidence %.2f\n", frame.pixels(0, wrist),
                  frame.pixels(1, wrist), frame.confidence[wrist]);
    }
  } catch (const mpc::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
