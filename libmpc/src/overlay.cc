#include "overlay.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/core/thread_pool.h"
#include "mpc/render/draw.h"
#include "mpc/seg/mask_bounds.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace mpc::internal {

void DrawOutline(const cv::Mat& mask, cv::Mat* picture) {
  const cv::Scalar yellow(0, 230, 255);
  const int thickness = std::max(1, std::max(picture->cols, picture->rows) / 900);
  const cv::Rect box = MaskBounds(mask);
  if (box.empty()) return;
  const cv::Rect around = Grown(box, thickness, mask.size());
  cv::Mat outline;
  cv::morphologyEx(mask(around), outline, cv::MORPH_GRADIENT,
                   cv::getStructuringElement(cv::MORPH_RECT, {thickness + 2, thickness + 2}));
  (*picture)(around).setTo(yellow, outline);
}

void DrawOverlay(const OverlayScene& scene, int frame, const Eigen::VectorXd& pose,
                 const Eigen::Matrix3Xf& surface, const cv::Mat& silhouette, cv::Mat* picture) {
  DrawMeshOverlay(scene.camera, surface, scene.character.mesh.triangles, picture);
  if (!silhouette.empty()) DrawOutline(silhouette, picture);
  KinematicState state;
  ForwardKinematics(scene.character.skeleton, pose, &state);
  std::vector<JointId> ids;
  for (const SkeletonJoint& joint : scene.character.skeleton.joints) ids.push_back(joint.id);
  DrawStickFigure(scene.camera, ids, state.joints, picture);
  DrawDetections(scene.detections.joints, scene.detections.frames[static_cast<size_t>(frame)],
                 picture);
}

bool WriteOverlay(const std::filesystem::path& path, VideoReader video, const OverlayScene& scene,
                  const Eigen::MatrixXd& poses, int num_threads, const ProgressCallback& progress) {
  const int num_frames = static_cast<int>(poses.cols());
  VideoWriter writer(path, video.width(), video.height(), video.fps(), VideoEffort::kLow);
  std::vector<cv::Mat> pictures(static_cast<size_t>(2 * ResolveNumThreads(num_threads)));
  for (int begin = 0; begin < num_frames;) {
    int count = 0;
    while (count < static_cast<int>(pictures.size()) && begin + count < num_frames &&
           video.Read(&pictures[static_cast<size_t>(count)])) {
      ++count;
    }
    if (count == 0) break;  // the reader tolerates a frame less than the file says
    ParallelFor(count, num_threads, [&](int i) {
      const Eigen::VectorXd pose = poses.col(begin + i);
      KinematicState state;
      ForwardKinematics(scene.character.skeleton, pose, &state);
      Eigen::Matrix3Xf vertices;
      SkinCharacter(scene.character, state, &vertices);
      DrawOverlay(scene, begin + i, pose, vertices, {}, &pictures[static_cast<size_t>(i)]);
    });
    for (int i = 0; i < count; ++i) writer.Write(pictures[static_cast<size_t>(i)]);
    begin += count;
    if (progress && !progress({"overlay", begin, num_frames})) return false;
  }
  writer.Close();
  return true;
}

}  // namespace mpc::internal
