#include "mpc/silhouettes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <utility>

#include "mpc/core/error.h"
#include "mpc/skeleton/skinning.h"
#include "silhouette_maker.h"

namespace mpc {

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

std::vector<int> BackgroundFrames(int num_frames) {
  constexpr int64_t kMostFrames = 24;
  const auto count = std::min<int64_t>(num_frames, kMostFrames);
  std::vector<int> frames;
  for (int64_t i = 0; i < count; ++i) {
    frames.push_back(static_cast<int>((i * num_frames + count - 1) / count));
  }
  return frames;
}

std::vector<SilhouetteRecord> ExtractSilhouettes(const PosedClip& clip,
                                                 const SilhouetteOptions& options,
                                                 const SilhouetteSink& sink,
                                                 const ProgressCallback& progress) {
  options.Validate();
  const internal::ClipView view(clip);
  std::optional<internal::BackgroundView> background =
      internal::BackgroundView::See(clip, view, options, "silhouettes", progress);
  if (!background) return {};
  const internal::SilhouetteMaker maker(clip, view, options, std::move(*background));
  const int num_frames = static_cast<int>(clip.poses.cols());
  struct Result {
    cv::Mat model;
    Silhouette silhouette;
    SilhouetteRecord record;
  };
  std::vector<Result> results(internal::NumClipSlots(options.num_threads));
  std::vector<SilhouetteRecord> records;
  internal::ForEachClipFrame(
      clip, view, options.num_threads,
      [&](const internal::ClipFrame& frame, size_t slot) {
        KinematicState state;
        ForwardKinematics(clip.character.skeleton, clip.poses.col(frame.index), &state);
        Eigen::Matrix3Xf vertices;
        SkinCharacter(clip.character, state, &vertices);
        Result& result = results[slot];
        maker.Model(vertices, &result.model);
        result.silhouette = maker.Make(state, vertices, result.model, frame, options.segmentation);
        result.record = maker.Record(result.silhouette, vertices, result.model, frame.truth);
      },
      [&](const internal::ClipFrame& frame, size_t slot) {
        const Result& result = results[slot];
        records.push_back(result.record);
        sink({frame.index, frame.picture, result.model, result.silhouette});
        return !progress || progress({"silhouettes", frame.index + 1, num_frames});
      });
  return records;
}

}  // namespace mpc
