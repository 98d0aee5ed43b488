#include "silhouette_maker.h"

#include <algorithm>
#include <utility>

#include "mpc/eval/metrics.h"
#include "mpc/render/raster.h"
#include "mpc/skeleton/skinning.h"

namespace mpc::internal {

namespace {
constexpr int kMaxPictureSide = 16384;  // of the rasteriser
}  // namespace

cv::Mat PosedModelMask(const Character& character, const Camera& camera,
                       const SurfaceTopology& topology, const Eigen::VectorXd& pose) {
  KinematicState state;
  ForwardKinematics(character.skeleton, pose, &state);
  Eigen::Matrix3Xf vertices;
  SkinCharacter(character, state, &vertices);
  cv::Mat mask;
  ModelMask(camera, vertices, topology, &mask);
  return mask;
}

SilhouetteMaker::SilhouetteMaker(const PosedClip& clip, const ClipView& view,
                                 const SilhouetteOptions& options, BackgroundView background)
    : clip_(clip),
      view_(view),
      options_(options),
      topology_(SurfaceTopology::FromMesh(clip.character.mesh)),
      limbs_(FindLimbs(clip.character)),
      background_(std::move(background)) {}

void SilhouetteMaker::Model(const Eigen::Matrix3Xf& vertices, cv::Mat* mask) const {
  ModelMask(view_.camera, vertices, topology_, mask);
}

cv::Mat SilhouetteMaker::WholeModel(const Eigen::Matrix3Xf& vertices) const {
  cv::Mat mask;
  ModelMask(clip_.camera, vertices, topology_, &mask);
  return mask;
}

Silhouette SilhouetteMaker::Make(const KinematicState& state, const Eigen::Matrix3Xf& vertices,
                                 const cv::Mat& model, const ClipFrame& frame,
                                 const SegmentationOptions& segmentation,
                                 const cv::Mat& earlier) const {
  if (!frame.given.empty()) {
    Silhouette silhouette = SilhouetteFromMask(frame.given, frame.picture.size());
    silhouette.model_iou = MaskIou(silhouette.mask, model);
    return silhouette;
  }
  FrameInput input;
  input.picture = frame.picture;
  input.previous = frame.previous;
  input.next = frame.next;
  input.model_mask = model;
  // The paper's R is not clipped to M.
  const cv::Mat clip =
      segmentation.clip_skeleton ? model : cv::Mat(model.size(), CV_8UC1, cv::Scalar(255));
  input.skeleton_mask =
      SkeletonMask(view_.camera, PoseLimbs(limbs_, state), options_.limb_thickness, clip);
  input.earlier = earlier;
  input.background = background_.At(frame.index);
  input.previous_from_current = frame.previous_from_current;
  input.next_from_current = frame.next_from_current;
  if (background_.rests()) {
    input.previous_from_current = input.next_from_current = cv::Matx33d::eye();
  }
  input.person_probability =
      PictureMask(view_.person_masks, frame.index, clip_.person_gap, frame.picture.size());
  input.actor_size_px = CutOffActorSizePx(vertices);
  return ExtractSilhouette(input, segmentation);
}

// Size of an actor that the picture cuts off, as a wider picture shows it; 0 for any other.
double SilhouetteMaker::CutOffActorSizePx(const Eigen::Matrix3Xf& vertices) const {
  const Camera& camera = view_.camera;
  const cv::Rect bounds = ProjectedBounds(camera, vertices);
  if (bounds.empty() || (bounds.x > 0 && bounds.y > 0 && bounds.br().x < camera.width &&
                         bounds.br().y < camera.height)) {
    return 0;
  }
  const auto margin = [](int side) { return std::min(side, (kMaxPictureSide - side) / 2); };
  const int dx = margin(camera.width), dy = margin(camera.height);
  cv::Mat wide;
  ModelMask(CroppedTo(camera, {-dx, -dy, camera.width + 2 * dx, camera.height + 2 * dy}), vertices,
            topology_, &wide);
  return ActorSizePx(wide);
}

SilhouetteRecord SilhouetteMaker::Record(const Silhouette& silhouette,
                                         const Eigen::Matrix3Xf& vertices, const cv::Mat& model,
                                         const cv::Mat& truth) const {
  SilhouetteRecord record = {.state = silhouette.state,
                             .confidence = silhouette.confidence,
                             .model_iou = silhouette.model_iou,
                             .camera_motion = silhouette.camera_motion};
  if (truth.empty()) return record;
  record.true_iou = MaskIou(EnlargedMask(silhouette.mask, truth.size()), truth);
  record.model_true_iou =
      MaskIou(model.size() == truth.size() ? model : WholeModel(vertices), truth);
  return record;
}

}  // namespace mpc::internal
