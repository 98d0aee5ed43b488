#include "mpc/refinement.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <deque>
#include <utility>

#include "clip_reader.h"
#include "clip_view.h"
#include "mpc/core/error.h"
#include "mpc/deform/refinement_smoother.h"
#include "mpc/eval/metrics.h"
#include "mpc/seg/contour.h"
#include "silhouette_maker.h"

namespace mpc {

ClipRefinementOptions ClipRefinementOptions::Paper() {
  ClipRefinementOptions options;
  options.silhouettes = SilhouetteOptions::Paper();
  options.second_extraction = SegmentationOptions::Paper();
  options.frames = FrameRefinementOptions::Paper();
  options.smoothing = SmoothingOptions::Paper();
  options.person_px = 0;
  return options;
}

void ClipRefinementOptions::Validate() const {
  silhouettes.Validate();
  second_extraction.Validate();
  frames.Validate();
  smoothing.Validate();
  if (!(person_px >= 0 && person_px <= 1e6)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("person_px is {}, expected 0 to 1e6", person_px));
  }
}

namespace {

constexpr double kUsualError2dMm = 7;    // that w_stab was chosen for
constexpr double kFirstCutSizePx = 170;  // at most, of a silhouette that only guides the pose

// The batch's poses are as good as the detections they follow: where those err less than the best
// networks, E_stab gets their precision, and their depth is the more certain.
FrameRefinementOptions HeldBy(double error_2d_mm, FrameRefinementOptions options) {
  const double gain = std::max(1.0, kUsualError2dMm / error_2d_mm);
  options.pose.weight_stab *= gain * gain;
  options.pose.depth_deviation /= gain * gain;
  return options;
}

// What the threads leave of a frame, and what its place in the smoothing's window keeps.
struct Result {
  FrameRefinement refinement;
  RefinementRecord record;
  cv::Mat silhouette;
  cv::Mat picture;
  cv::Mat truth;
  double surface_s = 0;
};

double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

class Stage {
 public:
  Stage(const PosedClip& clip, const internal::ClipView& view, const ClipRefinementOptions& options,
        internal::BackgroundView background)
      : clip_(clip),
        view_(view),
        options_(options),
        first_extraction_(options.silhouettes.segmentation),
        maker_(clip, view, options.silhouettes, std::move(background)),
        refiner_(clip.character, HeldBy(clip.error_2d_mm, options.frames)) {
    if (options.frames.level != RefinementLevel::kNone) {
      double& cut_size_px = first_extraction_.max_cut_size_px;
      cut_size_px = std::min(cut_size_px, kFirstCutSizePx);
    }
  }

  Result Process(internal::ClipFrame frame, CorrespondenceScratch* scratch) const {
    Result result;
    double last_outline_s = 0;
    const auto outline = [&](const PosedActor& actor) {
      cv::Mat model;
      maker_.Model(actor.vertices, &model);
      const SegmentationOptions& segmentation =
          actor.refined ? options_.second_extraction : first_extraction_;
      const Silhouette silhouette =
          maker_.Make(actor.state, actor.vertices, model, frame, segmentation, result.silhouette);
      result.record.silhouette = maker_.Record(silhouette, actor.vertices, model, frame.truth);
      if (!actor.refined) {
        result.record.batch_true_iou = result.record.silhouette.model_true_iou;
      }
      result.silhouette = silhouette.mask;
      frame.previous_from_current = silhouette.previous_from_current;
      frame.next_from_current = silhouette.next_from_current;
      Contour2d contour = IsEvidence(silhouette) ? ExtractContour(silhouette.mask) : Contour2d();
      last_outline_s = ThreadSeconds();
      return contour;
    };
    result.refinement =
        refiner_.Refine(view_.camera, clip_.poses.col(frame.index), outline, scratch);
    result.surface_s = ThreadSeconds() - last_outline_s;
    result.record.pose_state = result.refinement.pose_state;
    result.record.surface_state = result.refinement.surface_state;
    result.record.pose_support = result.refinement.pose_support;
    result.record.surface_support = result.refinement.surface_support;
    result.silhouette = internal::EnlargedMask(result.silhouette, frame.whole.size());
    result.picture = frame.whole;
    result.truth = frame.truth;
    return result;
  }

  double SurfaceIou(const Eigen::Matrix3Xf& vertices, const cv::Mat& truth) const {
    return MaskIou(maker_.WholeModel(vertices), truth);
  }

 private:
  // Where the picture could not decide the mask is the model's own and says nothing new.
  static bool IsEvidence(const Silhouette& silhouette) {
    return silhouette.state == SilhouetteState::kCut ||
           silhouette.state == SilhouetteState::kExternal;
  }

  const PosedClip& clip_;
  const internal::ClipView& view_;
  const ClipRefinementOptions& options_;
  SegmentationOptions first_extraction_;
  internal::SilhouetteMaker maker_;
  FrameRefiner refiner_;
};

}  // namespace

ClipRefinement RefineClip(const PosedClip& clip, const ClipRefinementOptions& options,
                          const RefinementSink& sink, const ProgressCallback& progress) {
  options.Validate();
  // Masks that are the user's own, or all that is asked for, keep their size.
  const bool whole = !clip.masks.empty() || options.frames.level == RefinementLevel::kNone;
  const internal::ClipView view(clip, whole ? 0 : options.person_px);
  std::optional<internal::BackgroundView> background =
      internal::BackgroundView::See(clip, view, options.silhouettes, "refinement", progress);
  ClipRefinement refinement;
  refinement.poses = clip.poses;
  if (!background) return refinement;
  const Stage stage(clip, view, options, std::move(*background));
  RefinementSmoother smoother(clip.character, internal::OpenVideo(clip).fps(), options.smoothing);
  const int num_frames = static_cast<int>(clip.poses.cols());
  const int num_threads = options.silhouettes.num_threads;

  std::deque<Result> waiting;  // for the frames after them
  SmoothedFrame smoothed;
  const auto deliver = [&] {
    while (smoother.Pop(&smoothed)) {
      Result result = std::move(waiting.front());
      waiting.pop_front();
      if (!result.truth.empty()) {
        result.record.surface_true_iou = stage.SurfaceIou(smoothed.vertices, result.truth);
      }
      const int f = static_cast<int>(refinement.frames.size());
      refinement.poses.col(f) = smoothed.pose;
      refinement.frames.push_back(result.record);
      sink({f, smoothed.pose, smoothed.vertices, result.silhouette, result.picture});
    }
  };

  std::vector<Result> results(internal::NumClipSlots(num_threads));
  std::vector<CorrespondenceScratch> scratch(results.size());
  const bool all = internal::ForEachClipFrame(
      clip, view, num_threads,
      [&](const internal::ClipFrame& frame, size_t slot) {
        results[slot] = stage.Process(frame, &scratch[slot]);
      },
      [&](const internal::ClipFrame& frame, size_t slot) {
        refinement.surface_s += results[slot].surface_s;
        smoother.Push(clip.poses.col(frame.index), std::move(results[slot].refinement));
        waiting.push_back(std::move(results[slot]));
        deliver();
        return !progress || progress({"refinement", frame.index + 1, num_frames});
      });
  if (all) {
    smoother.End();
    deliver();
  }
  return refinement;
}

}  // namespace mpc
