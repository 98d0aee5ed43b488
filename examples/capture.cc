// The whole capture from C++: a clip, an actor and detections in, a folder with the result out.
//
//   example_capture CLIP ACTOR.glb CAMERA.json DETECTIONS2D.json DETECTIONS3D.json OUTPUT

#include <cstdio>

#include "mpc/mpc.h"

int main(int argc, char** argv) {
  if (argc != 7) return 2;
  try {
    mpc::Capture capture({.video = argv[1],
                          .actor = argv[2],
                          .camera = argv[3],
                          .detections2d = argv[4],
                          .detections3d = argv[5]},
                         argv[6]);
    const mpc::CaptureReport report = capture.Run();
    std::printf("%d frames, root starts at %g %g %g m in the camera frame\n", report.num_frames,
                report.track.poses(0, 0), report.track.poses(1, 0), report.track.poses(2, 0));
  } catch (const mpc::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
