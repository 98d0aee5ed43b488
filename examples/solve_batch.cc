// Solves one batch (the first 50 frames) from detections alone: no video, no actor, no files out.
//
//   example_solve_batch CAMERA.json[:NAME] DETECTIONS2D.json DETECTIONS3D.json FPS

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "mpc/core/error.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/detections_file.h"
#include "mpc/pose/pose_estimator.h"

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  try {
    const mpc::Camera camera = mpc::ReadCamera(argv[1]);
    mpc::Detections2d detections2d = mpc::ReadDetections2d(argv[2]);
    mpc::Detections3d detections3d = mpc::ReadDetections3d(argv[3]);
    const double fps = std::atof(argv[4]);

    const mpc::PoseOptions options;
    const size_t num_frames =
        std::min<size_t>(detections2d.frames.size(), static_cast<size_t>(options.window_frames));
    detections2d.frames.resize(num_frames);
    detections3d.frames.resize(num_frames);

    const mpc::Skeleton skeleton = mpc::DefaultSkeleton(/*height_m=*/1.75);
    const mpc::PoseTrack track =
        mpc::EstimatePoses(skeleton, camera, detections2d, &detections3d, fps, options);
    for (size_t f = 0; f < track.frames.size(); ++f) {
      const mpc::FrameReport& frame = track.frames[f];
      std::printf("frame %2zu  %-12s residual %5.1f px  confidence %.2f\n", f,
                  mpc::TrackStateName(frame.state), frame.residual_px, frame.confidence);
    }
    std::printf("%d windows, %.1f ms per frame\n", track.num_windows,
                1000 * track.seconds_batch / static_cast<double>(num_frames));
  } catch (const mpc::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
