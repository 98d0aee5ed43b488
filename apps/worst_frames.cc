#include "worst_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "mpc/core/error.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/video.h"
#include "mpc/render/raster.h"
#include "mpc/skeleton/kinematics.h"

namespace monoperfcap {
namespace {

constexpr int kPicturesPerMetric = 4;
constexpr int kMaxPictureSide = 640;            // px
const cv::Scalar kCapturedColour(0, 220, 255);  // yellow
const cv::Scalar kTrueColour(255, 80, 255);     // magenta

enum class Shown { kOutlines, kSticks };

// Frames with the largest badness, at least a thirtieth of the clip apart.
std::vector<int> Worst(const Eigen::VectorXd& badness) {
  std::vector<int> order(static_cast<size_t>(badness.size()));
  std::iota(order.begin(), order.end(), 0);
  std::erase_if(order, [&](int f) { return !std::isfinite(badness[f]); });
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return badness[a] > badness[b]; });
  const int distance = std::max(2, static_cast<int>(badness.size()) / 30);
  std::vector<int> worst;
  for (const int f : order) {
    if (worst.size() == kPicturesPerMetric) break;
    const bool is_near =
        std::any_of(worst.begin(), worst.end(), [&](int g) { return std::abs(f - g) < distance; });
    if (!is_near) worst.push_back(f);
  }
  return worst;
}

std::map<int, Shown> ChooseFrames(const Evaluation& evaluation) {
  std::map<int, Shown> frames;
  if (evaluation.model) {
    for (const int f : Worst(-evaluation.model->iou)) frames.emplace(f, Shown::kOutlines);
  }
  for (const int f : Worst(evaluation.errors.root.per_frame_mm)) frames.emplace(f, Shown::kSticks);
  return frames;
}

void DrawContours(const cv::Mat& mask, const cv::Scalar& colour, cv::Mat* picture) {
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(mask, contours, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
  const int thickness = std::max(1, std::max(picture->cols, picture->rows) / 640);
  cv::drawContours(*picture, contours, -1, colour, thickness, cv::LINE_AA);
}

void DrawSticks(const mpc::Camera& camera, std::span<const mpc::JointId> joints,
                const Eigen::VectorXd& positions, const cv::Scalar& colour, cv::Mat* picture) {
  const auto pixel = [&](mpc::JointId id, cv::Point2d* point) {
    const auto it = std::find(joints.begin(), joints.end(), id);
    if (it == joints.end()) return false;
    const Eigen::Vector3d x = positions.segment<3>(3 * (it - joints.begin()));
    Eigen::Vector2d projected;
    if (!x.allFinite() || !mpc::Project(camera, x, &projected)) return false;
    if (projected.cwiseAbs().maxCoeff() > 1e5) return false;
    *point = {projected.x(), projected.y()};
    return true;
  };
  const int thickness = std::max(1, std::max(picture->cols, picture->rows) / 400);
  for (const mpc::JointPair& bone : mpc::StickFigure()) {
    cv::Point2d a, b;
    if (!pixel(bone.a, &a) || !pixel(bone.b, &b)) continue;
    cv::line(*picture, a, b, colour, thickness, cv::LINE_AA);
  }
}

// The part of the picture around the actor, not larger than a page needs.
cv::Mat AroundActor(const cv::Mat& picture, cv::Rect actor) {
  const cv::Rect whole(0, 0, picture.cols, picture.rows);
  const int margin = std::max(actor.width, actor.height) / 5 + 8;
  actor = cv::Rect(actor.x - margin, actor.y - margin, actor.width + 2 * margin,
                   actor.height + 2 * margin) &
          whole;
  if (actor.empty()) actor = whole;
  cv::Mat part = picture(actor).clone();
  const double scale = static_cast<double>(kMaxPictureSide) / std::max(part.cols, part.rows);
  if (scale < 1) cv::resize(part, part, {}, scale, scale, cv::INTER_AREA);
  return part;
}

class PictureMaker {
 public:
  PictureMaker(const Performance& performance, const Truth& truth, const Evaluation& evaluation)
      : performance_(performance), truth_(truth), evaluation_(evaluation) {}

  // true_mask may be empty.
  FramePicture Make(int frame, Shown shown, const cv::Mat& picture,
                    const cv::Mat& true_mask) const {
    Eigen::Matrix3Xf vertices;
    PoseVertices(performance_, frame, &vertices);
    FramePicture result{.frame = frame, .caption = Caption(frame), .bgr = {}};
    cv::Mat drawn = picture.clone();
    if (shown == Shown::kOutlines) {
      const cv::Mat captured =
          mpc::MeshMask(performance_.camera, vertices, performance_.character.mesh.triangles);
      DrawContours(captured, kCapturedColour, &drawn);
      if (!true_mask.empty()) DrawContours(true_mask, kTrueColour, &drawn);
    } else {
      DrawBothSticks(frame, &drawn);
    }
    cv::Rect actor = mpc::ProjectedBounds(performance_.camera, vertices);
    if (!true_mask.empty()) actor |= cv::boundingRect(true_mask);
    result.bgr = AroundActor(drawn, actor);
    return result;
  }

 private:
  void DrawBothSticks(int frame, cv::Mat* picture) const {
    const mpc::Skeleton& skeleton = performance_.character.skeleton;
    std::vector<mpc::JointId> ids;
    for (const mpc::SkeletonJoint& joint : skeleton.joints) ids.push_back(joint.id);
    mpc::KinematicState state;
    mpc::ForwardKinematics(skeleton, performance_.poses.col(frame), &state);
    const mpc::CameraFromWorld place = CameraPlace(performance_, truth_, frame);
    Eigen::VectorXd expected = truth_.joints.positions.col(frame);
    for (Eigen::Index row = 0; row < expected.size(); row += 3) {
      expected.segment<3>(row) = place * expected.segment<3>(row);
    }
    DrawSticks(performance_.camera, truth_.joints.joints, expected, kTrueColour, picture);
    DrawSticks(performance_.camera, ids, state.joints.reshaped(), kCapturedColour, picture);
  }

  std::string Caption(int frame) const {
    std::string caption = fmt::format("frame {}: MPJPE {:.0f} mm", frame,
                                      evaluation_.errors.root.per_frame_mm[frame]);
    if (evaluation_.model) caption += fmt::format(", IoU {:.3f}", evaluation_.model->iou[frame]);
    if (evaluation_.surface) {
      caption += fmt::format(", vertices {:.0f} mm", evaluation_.surface->vertex_mm[frame]);
    }
    return caption;
  }

  const Performance& performance_;
  const Truth& truth_;
  const Evaluation& evaluation_;
};

}  // namespace

std::vector<FramePicture> WorstFrames(const Performance& performance, const Truth& truth,
                                      const Evaluation& evaluation,
                                      const std::filesystem::path& video, double image_fps) {
  const std::map<int, Shown> frames = ChooseFrames(evaluation);
  mpc::VideoReader reader(video, image_fps);
  const mpc::Camera& camera = performance.camera;
  if (reader.width() != camera.width || reader.height() != camera.height) {
    throw mpc::Error(mpc::ErrorCode::kMismatch,
                     fmt::format("{} is {} x {}, the capture's camera {} x {}", video.string(),
                                 reader.width(), reader.height(), camera.width, camera.height));
  }
  std::optional<mpc::MaskReader> masks;
  if (!truth.masks.empty()) masks.emplace(truth.masks, camera.width, camera.height);
  const PictureMaker maker(performance, truth, evaluation);
  std::vector<FramePicture> pictures;
  const int end = frames.empty() ? 0 : frames.rbegin()->first + 1;
  for (int f = 0; f < end; ++f) {
    cv::Mat picture, mask;
    if (!reader.Read(&picture)) {
      throw mpc::Error(mpc::ErrorCode::kMismatch,
                       fmt::format("{} has {} frames, the capture {}", video.string(), f,
                                   performance.poses.cols()));
    }
    if (masks && !masks->Read(&mask)) mask.release();
    const auto it = frames.find(f);
    if (it != frames.end()) pictures.push_back(maker.Make(f, it->second, picture, mask));
  }
  return pictures;
}

}  // namespace monoperfcap
