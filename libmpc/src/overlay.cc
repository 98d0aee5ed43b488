#include "overlay.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/core/thread_pool.h"
#include "mpc/render/draw.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace mpc::internal {
namespace {

void DrawFrame(const OverlayScene& scene, int f, cv::Mat* picture) {
  KinematicState state;
  ForwardKinematics(scene.character.skeleton, scene.track.poses.col(f), &state);
  Eigen::Matrix3Xf vertices;
  SkinCharacter(scene.character, state, &vertices);
  DrawMeshOverlay(scene.camera, vertices, scene.character.mesh.triangles, picture);
  const std::vector<SkeletonJoint>& joints = scene.character.skeleton.joints;
  std::vector<JointId> ids;
  for (const SkeletonJoint& joint : joints) ids.push_back(joint.id);
  DrawStickFigure(scene.camera, ids, state.joints, picture);
  DrawDetections(scene.detections.joints, scene.detections.frames[static_cast<size_t>(f)], picture);
}

}  // namespace

bool WriteOverlay(const std::filesystem::path& path, VideoReader video, const OverlayScene& scene,
                  int num_threads, const ProgressCallback& progress) {
  const int num_frames = static_cast<int>(scene.track.frames.size());
  VideoWriter writer(path, video.width(), video.height(), video.fps());
  std::vector<cv::Mat> pictures(static_cast<size_t>(2 * ResolveNumThreads(num_threads)));
  for (int begin = 0; begin < num_frames;) {
    int count = 0;
    while (count < static_cast<int>(pictures.size()) && begin + count < num_frames &&
           video.Read(&pictures[static_cast<size_t>(count)])) {
      ++count;
    }
    if (count == 0) break;  // the reader tolerates a frame less than the file says
    ParallelFor(count, num_threads,
                [&](int i) { DrawFrame(scene, begin + i, &pictures[static_cast<size_t>(i)]); });
    for (int i = 0; i < count; ++i) writer.Write(pictures[static_cast<size_t>(i)]);
    begin += count;
    if (progress && !progress({"overlay", begin, num_frames})) return false;
  }
  writer.Close();
  return true;
}

}  // namespace mpc::internal
