// Purpose: what every frame's camera sees behind the actor.
// Source: ours. Frames: pictures, pixel centres at integers. Symbols: F frames.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "clip_view.h"
#include "mpc/core/progress.h"
#include "mpc/seg/background_plate.h"
#include "mpc/silhouettes.h"

namespace mpc::internal {

// For a camera at rest one picture. Where the places of a moving one are known, a wider picture that looks
// the middle way, up to twice as wide and high: only its turns are taken out, since most of what is behind
// an actor is far away; what is not has a large spread and says nothing.
class BackgroundView {
 public:
  // No background is known.
  BackgroundView() = default;
  // From some pictures of the clip; nothing is known where it is not asked for. Reports the first step of
  // `stage` for each of them; no view when the callback stopped it.
  static std::optional<BackgroundView> See(const PosedClip& clip, const ClipView& view,
                                           const SilhouetteOptions& options, const char* stage,
                                           const ProgressCallback& progress);

  // The background in a frame's picture.
  BackgroundPlate At(int frame) const;

  // The camera was seen to rest all the while: in each of those pictures the background is where it was in
  // the one before.
  bool rests() const { return rests_; }

 private:
  BackgroundPlate plate_;
  bool rests_ = false;
  cv::Size picture_size_;
  // Per frame, where its picture lies on the plate; no frames: a camera at rest.
  std::vector<std::optional<cv::Matx33d>> plate_from_picture_;
};

}  // namespace mpc::internal
