#include "mpc/silhouettes.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/eval/metrics.h"
#include "mpc/io/mask_file.h"
#include "mpc/render/model_mask.h"
#include "mpc/render/raster.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/limbs.h"
#include "mpc/skeleton/skinning.h"

namespace mpc {
namespace {

constexpr int kMaxPictureSide = 16384;  // of the rasteriser

// One frame on its way through a chunk.
struct Work {
  cv::Mat picture;
  cv::Mat given;  // the user's mask
  cv::Mat truth;
  cv::Mat model;
  Silhouette silhouette;
  SilhouetteRecord record;
};

class Stage {
 public:
  Stage(const PosedClip& clip, const SilhouetteOptions& options)
      : clip_(clip),
        options_(options),
        topology_(SurfaceTopology::FromMesh(clip.character.mesh)),
        limbs_(FindLimbs(clip.character)) {}

  // previous: the picture before, or for the first frame the next; empty if there is none.
  void Process(int f, const cv::Mat& previous, Work* work) const {
    KinematicState state;
    ForwardKinematics(clip_.character.skeleton, clip_.poses.col(f), &state);
    Eigen::Matrix3Xf vertices;
    SkinCharacter(clip_.character, state, &vertices);
    ModelMask(clip_.camera, vertices, topology_, &work->model);
    if (work->given.empty()) {
      work->silhouette = Extract(state, vertices, previous, *work);
    } else {
      work->silhouette = SilhouetteFromMask(work->given, work->picture.size());
      work->silhouette.model_iou = MaskIou(work->silhouette.mask, work->model);
    }
    const Silhouette& silhouette = work->silhouette;
    work->record = {.state = silhouette.state,
                    .confidence = silhouette.confidence,
                    .model_iou = silhouette.model_iou,
                    .camera_motion = silhouette.camera_motion};
    if (!work->truth.empty()) {
      work->record.true_iou = MaskIou(silhouette.mask, work->truth);
      work->record.model_true_iou = MaskIou(work->model, work->truth);
    }
  }

 private:
  Silhouette Extract(const KinematicState& state, const Eigen::Matrix3Xf& vertices,
                     const cv::Mat& previous, const Work& work) const {
    FrameInput input;
    input.picture = work.picture;
    input.previous = previous;
    input.model_mask = work.model;
    // The paper's R is not clipped to M.
    const cv::Mat clip = options_.segmentation.clip_skeleton
                             ? work.model
                             : cv::Mat(work.model.size(), CV_8UC1, cv::Scalar(255));
    input.skeleton_mask =
        SkeletonMask(clip_.camera, PoseLimbs(limbs_, state), options_.limb_thickness, clip);
    input.actor_size_px = CutOffActorSizePx(vertices);
    return ExtractSilhouette(input, options_.segmentation);
  }

  // Size of an actor that the picture cuts off, as a wider picture shows it; 0 for any other.
  double CutOffActorSizePx(const Eigen::Matrix3Xf& vertices) const {
    const Camera& camera = clip_.camera;
    const cv::Rect bounds = ProjectedBounds(camera, vertices);
    if (bounds.empty() || (bounds.x > 0 && bounds.y > 0 && bounds.br().x < camera.width &&
                           bounds.br().y < camera.height)) {
      return 0;
    }
    const auto margin = [](int side) { return std::min(side, (kMaxPictureSide - side) / 2); };
    const int dx = margin(camera.width), dy = margin(camera.height);
    cv::Mat wide;
    ModelMask(CroppedTo(camera, {-dx, -dy, camera.width + 2 * dx, camera.height + 2 * dy}),
              vertices, topology_, &wide);
    return ActorSizePx(wide);
  }

  const PosedClip& clip_;
  const SilhouetteOptions& options_;
  SurfaceTopology topology_;
  std::vector<Limb> limbs_;
};

// The pictures of a clip with the masks that belong to them.
class ClipReader {
 public:
  explicit ClipReader(const PosedClip& clip)
      : clip_(clip), video_(clip.video, clip.image_fps), num_frames_(clip.poses.cols()) {
    if (video_.width() != clip.camera.width || video_.height() != clip.camera.height) {
      throw Error(
          ErrorCode::kMismatch,
          fmt::format("{} is {} x {}, the camera {} x {}", clip.video.string(), video_.width(),
                      video_.height(), clip.camera.width, clip.camera.height));
    }
    if (!clip.masks.empty()) masks_.emplace(clip.masks, video_.width(), video_.height());
    if (!clip.true_masks.empty()) truth_.emplace(clip.true_masks, video_.width(), video_.height());
  }

  void Read(Work* work) {
    if (!video_.Read(&work->picture)) ThrowEnd(clip_.video);
    if (masks_ && !masks_->Read(&work->given)) ThrowEnd(clip_.masks);
    if (truth_ && !truth_->Read(&work->truth)) ThrowEnd(clip_.true_masks);
    ++num_read_;
  }

  void ExpectEnd() {
    Work extra;
    if (video_.Read(&extra.picture)) ThrowTooLong(clip_.video);
    if (masks_ && masks_->Read(&extra.given)) ThrowTooLong(clip_.masks);
    if (truth_ && truth_->Read(&extra.truth)) ThrowTooLong(clip_.true_masks);
  }

 private:
  [[noreturn]] void ThrowEnd(const std::filesystem::path& path) const {
    throw Error(ErrorCode::kMismatch, fmt::format("{} has {} frames, but the actor has {} poses",
                                                  path.string(), num_read_, num_frames_));
  }
  [[noreturn]] void ThrowTooLong(const std::filesystem::path& path) const {
    throw Error(ErrorCode::kMismatch, fmt::format("{} has more frames than the actor's {} poses",
                                                  path.string(), num_frames_));
  }

  const PosedClip& clip_;
  VideoReader video_;
  std::optional<MaskReader> masks_;
  std::optional<MaskReader> truth_;
  Eigen::Index num_frames_;
  int num_read_ = 0;
};

}  // namespace

SilhouetteOptions SilhouetteOptions::Paper() {
  SilhouetteOptions options;
  options.segmentation = SegmentationOptions::Paper();
  options.limb_thickness = 0;
  return options;
}

void SilhouetteOptions::Validate() const {
  segmentation.Validate();
  if (!(limb_thickness >= 0 && limb_thickness <= 1)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("limb_thickness is {}, expected 0 to 1", limb_thickness));
  }
}

std::vector<SilhouetteRecord> ExtractSilhouettes(const PosedClip& clip,
                                                 const SilhouetteOptions& options,
                                                 const SilhouetteSink& sink,
                                                 const ProgressCallback& progress) {
  options.Validate();
  const Stage stage(clip, options);
  ClipReader reader(clip);
  const int num_frames = static_cast<int>(clip.poses.cols());
  // At least two: the first frame looks at the second.
  std::vector<Work> chunk(static_cast<size_t>(2 * ResolveNumThreads(options.num_threads)));
  std::vector<SilhouetteRecord> records;
  cv::Mat before;  // the last picture of the chunk before
  for (int begin = 0; begin < num_frames;) {
    const int count = std::min(static_cast<int>(chunk.size()), num_frames - begin);
    for (int i = 0; i < count; ++i) reader.Read(&chunk[static_cast<size_t>(i)]);
    const auto previous = [&](int i) {
      if (i > 0) return chunk[static_cast<size_t>(i) - 1].picture;
      return begin == 0 && count > 1 ? chunk[1].picture : before;
    };
    ParallelFor(count, options.num_threads, [&](int i) {
      stage.Process(begin + i, previous(i), &chunk[static_cast<size_t>(i)]);
    });
    for (int i = 0; i < count; ++i) {
      const Work& work = chunk[static_cast<size_t>(i)];
      records.push_back(work.record);
      sink({begin + i, work.picture, work.model, work.silhouette});
    }
    before = chunk[static_cast<size_t>(count) - 1].picture.clone();
    begin += count;
    if (progress && !progress({"silhouettes", begin, num_frames}) && begin < num_frames) {
      return records;
    }
  }
  reader.ExpectEnd();
  return records;
}

}  // namespace mpc
