// Purpose: what is behind the actor, from the pictures in which the actor is elsewhere.
// Source: ours (median over time); what a cut makes of it: mpc/seg/silhouette.h.
// Frames: pictures, pixel centres at integers; the plate of a camera at rest is one of them.
// Units: pixels, 8-bit colour steps.
// Symbols: M mask of the actor's mesh.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>

namespace mpc {

struct BackgroundPlate {
  static constexpr uint8_t kUnknown = 255;

  cv::Mat picture;  // CV_8UC3 (BGR); means nothing where it is unknown
  cv::Mat spread;   // CV_8U: standard deviation of the colours seen there, or kUnknown

  bool empty() const { return picture.empty(); }
};

struct PlateSample {
  cv::Mat picture;     // of any type that ExtractSilhouette takes
  cv::Mat model_mask;  // M, CV_8U, nonzero inside
  // Where its pixels lie on the plate, for a camera that turns; none: where they are.
  std::optional<cv::Matx33d> plate_from_picture = {};
};

// Per pixel the median of the samples in which M is far away, at least three; else of those in which
// M is near but elsewhere, if there are five and they agree. A pixel that M never leaves, or that
// keeps changing (a moving camera, water), is unknown or has a large spread, and says nothing then.
// `size` is the plate's, that of the samples if it is empty; all samples need a place on it otherwise.
// Deterministic, identical for any number of threads. Throws Error (kInvalidArgument, kMismatch,
// kUnsupported) for no samples, for more than 255, and for what ExtractSilhouette would refuse.
BackgroundPlate MakeBackgroundPlate(std::span<const PlateSample> samples, int num_threads = 1,
                                    const cv::Size& size = {});

// What a picture of `size` sees of the plate; unknown where that does not reach.
BackgroundPlate ViewOfPlate(const BackgroundPlate& plate, const cv::Matx33d& plate_from_picture,
                            const cv::Size& size);

}  // namespace mpc
